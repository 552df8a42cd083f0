#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

/// A file read from its start. Requests beyond its end are refused before memory is allocated.
class InputFile final {
 public:
  [[nodiscard]] static Expected<InputFile> open(const std::string& path);

  /// The next `n` bytes. @return false, and nothing is read, when fewer are left
  [[nodiscard]] bool read(std::uint64_t n, std::vector<std::byte>& out);
  [[nodiscard]] bool skip(std::uint64_t n) { return n <= left() && seek(at_ + n); }
  /// Moves to `at`. @return false beyond the end
  [[nodiscard]] bool seek(std::uint64_t at) {
    if (at > size_) return false;
    file_.clear();
    if (!file_.seekg(static_cast<std::streamoff>(at))) return false;
    at_ = at;
    return true;
  }

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint64_t at() const { return at_; }
  [[nodiscard]] std::uint64_t left() const { return size_ - at_; }
  /// Share that was read, 0 to 1.
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

/// A file in a ZIP archive, according to its directory.
struct ZipEntry {
  std::string name;  ///< With folders, as in the archive; never used as a path.
  std::uint16_t method{};
  std::uint32_t crc{};
  std::uint64_t packed_bytes{};
  std::uint64_t bytes{};
  std::uint64_t at{};  ///< Of its head in the archive.
};

/// Directory and files (stored, deflated) of a ZIP archive; not encrypted, not split, at most 4 GB.
class ZipArchive final {
 public:
  [[nodiscard]] static Expected<ZipArchive> open(const std::string& path);

  [[nodiscard]] const std::vector<ZipEntry>& entries() const { return entries_; }
  /// Writes `entry` to a new file. Fails beyond its stated size, or 1 GiB beyond the archive.
  [[nodiscard]] Expected<void> unpack(const ZipEntry& entry, const std::filesystem::path& to);

 private:
  explicit ZipArchive(std::string path) : path_(std::move(path)) {}
  Expected<void> read_directory();
  Expected<void> read_entries(std::vector<std::byte> directory, std::size_t count);

  std::string path_;
  std::uint64_t size_{0};
  std::vector<ZipEntry> entries_;
  std::uint64_t may_unpack_{0};
};

}  // namespace fiducap
