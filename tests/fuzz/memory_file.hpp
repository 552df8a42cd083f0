#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <span>
#include <string>

#include "base/log.hpp"

namespace fiducap::fuzz {

/// What is wrong with an input is not said a thousand times a second.
inline const bool kQuiet = [] {
  log::set_level(log::Level::kError);
  return true;
}();

inline void require(bool holds) {
  if (!holds) std::abort();
}

/// A file without a disk, for parsers that want a path.
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

/// The first byte of an input chooses what the rest is meant for.
struct Chosen {
  unsigned which{};
  std::span<const std::byte> bytes;

  Chosen(const std::uint8_t* data, std::size_t size, unsigned kinds)
      : which(size == 0 ? 0 : data[0] % kinds),
        bytes(size == 0 ? std::span<const std::byte>()
                        : std::as_bytes(std::span(data, size)).subspan(1)) {}
  [[nodiscard]] std::string text() const {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
};

}  // namespace fiducap::fuzz
