#pragma once

#include <chrono>
#include <ostream>
#include <streambuf>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "base/expected.hpp"
#include "base/text.hpp"

namespace fiducap {

inline constexpr int kExitOk = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = 2;

/// Where a verb writes: results to `out`, everything else to `err`.
struct Terminal {
  std::ostream& out;
  std::ostream& err;
  bool out_is_live{false};  ///< `out` is a terminal: lines may be redrawn.
  bool err_is_live{false};
};

/// `1 image`, `2 images`
[[nodiscard]] inline std::string counted(std::size_t number, const char* one, const char* several) {
  return std::to_string(number) + " " + (number == 1 ? one : several);
}

/// Passes text on to a stream that may be a terminal. Texts come from files and networks, so all
/// but line feeds and tabs is made `printable`.
class PrintableOutput final : public std::streambuf {
 public:
  explicit PrintableOutput(std::ostream& to) : to_(to) {}
  /// Our own control sequences.
  void pass(std::string_view bytes);

 private:
  int_type overflow(int_type c) override;
  std::streamsize xsputn(const char* text, std::streamsize size) override;
  int sync() override;
  void write(std::string_view text);

  std::ostream& to_;
  std::string begun_;  ///< First bytes of a UTF-8 character.
};

/// Writes control sequences to a Terminal's stream. The text between them must be printable.
void draw(std::ostream& to, std::string_view text);

/// Writes the error to `err`. @return kExitFailed
int report(const Terminal& terminal, const Error& error);

/// The error; `context` is added when it has none.
[[nodiscard]] Error in_context(Error error, const std::string& context);

/// Writes the value to `out`, for scripts. @return kExitOk
int print_json(const Terminal& terminal, const nlohmann::ordered_json& json);

/// A line on `err` that is redrawn at most five times a second and wiped at the end; nothing when
/// `err` is no terminal.
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

/// From now on the first Ctrl-C or SIGTERM only makes interrupted() true; the second ends the
/// process as usual.
void catch_interrupt();
[[nodiscard]] bool interrupted();

}  // namespace fiducap
