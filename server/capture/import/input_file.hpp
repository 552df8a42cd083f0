#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

/// A file read from its start. What it is asked for is never more than what it has left, so that a
/// few bytes that speak of gigabytes cost nothing.
class InputFile final {
 public:
  [[nodiscard]] static Expected<InputFile> open(const std::string& path);

  /// The next `n` bytes. @return false, and nothing is read, when fewer are left
  [[nodiscard]] bool read(std::uint64_t n, std::vector<std::byte>& out);
  [[nodiscard]] bool skip(std::uint64_t n);
  /// Moves to `at`. @return false beyond the end
  [[nodiscard]] bool seek(std::uint64_t at);

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint64_t at() const { return at_; }
  [[nodiscard]] std::uint64_t left() const { return size_ - at_; }
  /// How much of it is read, 0 to 1.
  [[nodiscard]] double share() const {
    return size_ == 0 ? 1.0 : static_cast<double>(at_) / static_cast<double>(size_);
  }

 private:
  InputFile() = default;

  std::string path_;
  std::ifstream file_;
  std::uint64_t size_{0};
  std::uint64_t at_{0};
};

}  // namespace fiducap
