#pragma once

#include <optional>
#include <string>
#include <utility>

#include "base/expected.hpp"

namespace fiducap {

/// One process at a time has a file: an advisory lock on `<path>.lock`, given back when this is
/// destroyed or when its process ends, however it ends. Links to the file share its lock.
class FileClaim final {
 public:
  /// @return Error `kUnavailable` naming the process that has it
  [[nodiscard]] static Expected<FileClaim> take(const std::string& path);
  /// Who has it now, e.g. `process 4711`; nullopt: nobody, as far as we may look.
  [[nodiscard]] static std::optional<std::string> holder(const std::string& path);
  ~FileClaim();
  FileClaim(FileClaim&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  FileClaim& operator=(FileClaim&&) = delete;

 private:
  explicit FileClaim(int file) : file_(file) {}

  int file_;
};

}  // namespace fiducap
