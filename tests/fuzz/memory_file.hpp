#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <string>
#include <string_view>

#include "base/log.hpp"
#include "fuzz/target.hpp"

namespace fiducap::fuzz {

/// Faults of an input are not logged a thousand times a second.
inline const bool kQuiet = [] {
  log::set_level(log::Level::kError);
  return true;
}();

/// A file without a disk, for parsers with a path.
class MemoryFile final {
 public:
  MemoryFile() : number_(::memfd_create("fuzz", MFD_CLOEXEC)) { require(number_ >= 0); }
  ~MemoryFile() { ::close(number_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(number_); }
  void put(std::span<const std::byte> bytes) const {
    require(::ftruncate(number_, 0) == 0);
    require(::pwrite(number_, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()));
  }
  void put(std::string_view text) const { put(std::as_bytes(std::span(text))); }

 private:
  int number_;
};

}  // namespace fiducap::fuzz
