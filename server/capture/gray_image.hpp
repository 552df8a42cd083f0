#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/object_pool.hpp"

namespace fiducap {

/// 8-bit gray pixels, rows packed. Pixel (0, 0) is the upper-left one; u grows right, v grows down.
struct GrayImage {
  int width{};
  int height{};
  std::vector<std::uint8_t> pixels;  ///< height × width

  /// Sets the size, keeps the memory.
  void resize(int w, int h) {
    width = w;
    height = h;
    pixels.resize(static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
  }
};

using GrayImagePool = ObjectPool<GrayImage>;

}  // namespace fiducap
