#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

namespace fiducap::fuzz {

inline void require(bool holds) {
  if (!holds) std::abort();
}

struct Input {
  std::span<const std::byte> bytes;

  Input(const std::uint8_t* data, std::size_t size) : bytes(std::as_bytes(std::span(data, size))) {}
  [[nodiscard]] std::string text() const {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  /// Takes the first byte off. @return a number below `kinds`; 0 without bytes
  unsigned choose(unsigned kinds) {
    if (bytes.empty()) return 0;
    const unsigned first = std::to_integer<unsigned>(bytes.front());
    bytes = bytes.subspan(1);
    return first % kinds;
  }
};

/// Calls take(piece) with pieces of this size until it returns false. @param size  0: one piece
template <typename Take>
void in_pieces(std::span<const std::byte> bytes, std::size_t size, Take take) {
  while (!bytes.empty()) {
    const auto piece = bytes.first(size == 0 ? bytes.size() : std::min(size, bytes.size()));
    bytes = bytes.subspan(piece.size());
    if (!take(piece)) return;
  }
}

}  // namespace fiducap::fuzz

/// FUZZ(name, input) { … } defines a target; `name` is in CMakeLists.txt, `input` a fuzz::Input.
#define FUZZ(name, input)                                           \
  static void name##_one(fiducap::fuzz::Input input);               \
  extern "C" int name(const std::uint8_t* data, std::size_t size) { \
    name##_one({data, size});                                       \
    return 0;                                                       \
  }                                                                 \
  static void name##_one([[maybe_unused]] fiducap::fuzz::Input input)

using namespace fiducap;
using namespace fiducap::fuzz;
