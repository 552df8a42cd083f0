#pragma once

#include <chrono>
#include <functional>
#include <ostream>
#include <string>

#include "base/expected.hpp"
#include "base/text.hpp"

namespace fiducap {

inline constexpr int kExitOk = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = 2;

/// Where a verb speaks: results to `out`, everything else to `err`.
struct Terminal {
  std::ostream& out;
  std::ostream& err;
  bool out_is_live{false};  ///< A person looks at `out` right now: lines may be redrawn.
  bool err_is_live{false};
};

/// What the command line asks for, to be run when all of it has been read. @return exit code
using ChosenVerb = std::function<int(const Terminal&)>;

/// Says what went wrong. @return kExitFailed
int report(const Terminal& terminal, const Error& error);

/// One line on `err` that grows old gracefully: redrawn at most five times a second, wiped at the
/// end; nothing at all when it is no terminal.
class ProgressLine final {
 public:
  explicit ProgressLine(const Terminal& terminal) : terminal_(terminal) {}
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void show(const std::string& text);

 private:
  const Terminal& terminal_;
  std::chrono::steady_clock::time_point last_{};
  bool shown_{false};
};

}  // namespace fiducap
