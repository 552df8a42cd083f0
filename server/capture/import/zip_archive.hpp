#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

/// A file in a ZIP archive, as its directory says.
struct ZipEntry {
  std::string name;  ///< With folders, as written: never a path of ours.
  std::uint16_t method{};
  std::uint32_t crc{};
  std::uint64_t packed_bytes{};
  std::uint64_t bytes{};
  std::uint64_t at{};  ///< Of its head in the archive.
};

/// The directory of a ZIP archive, and its files one by one. Stored and deflated files; not
/// encrypted, not of several disks, not beyond 4 GB.
class ZipArchive final {
 public:
  [[nodiscard]] static Expected<ZipArchive> open(const std::string& path);

  [[nodiscard]] const std::vector<ZipEntry>& entries() const { return entries_; }
  /// Writes the content of `entry` to a new file `to`. Ends where more comes out than the directory
  /// says, or more than a whole archive may hold (1 GiB more than it is long).
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
