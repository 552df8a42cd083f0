#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace fiducap::simulation {

/// What falls onto the sensor before it is read out: gray values 0..255 with seven bits below the
/// point.
struct GrayCanvas {
  static constexpr int kFraction = 128;
  /// Brighter ones are kept as this: twice what the sensor can tell, so that vignetting does not
  /// bring back what is white.
  static constexpr int kMost = 65535 / kFraction;

  int width{};
  int height{};
  std::vector<std::uint16_t> values;

  GrayCanvas(int w, int h)
      : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
  [[nodiscard]] std::uint16_t* row(int v) {
    return values.data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(width);
  }
};

}  // namespace fiducap::simulation
