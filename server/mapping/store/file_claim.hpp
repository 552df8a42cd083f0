#pragma once

#include <optional>
#include <string>
#include <utility>

#include "base/expected.hpp"

namespace fiducap {

/// Exclusive use of a file by one process: an advisory lock on `<path>.lock`, released when this is
/// destroyed or its process ends, in any way. Links to the file share its lock.
class FileClaim final {
 public:
  /// @return Error `kUnavailable` naming the process that has it
  [[nodiscard]] static Expected<FileClaim> take(const std::string& path);
  /// The process that has it now, e.g. `process 4711`; nullopt: none, or not readable.
  [[nodiscard]] static std::optional<std::string> holder(const std::string& path);
  ~FileClaim();
  FileClaim(FileClaim&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  FileClaim& operator=(FileClaim&&) = delete;

 private:
  explicit FileClaim(int file) : file_(file) {}

  int file_;
};

}  // namespace fiducap
