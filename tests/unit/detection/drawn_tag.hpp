#pragma once

#include "capture/gray_image.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {

/// A white wall with nothing on it.
inline GrayImage white_wall(int width = 640, int height = 480, std::uint8_t gray = 220) {
  GrayImage image;
  image.resize(width, height);
  std::fill(image.pixels.begin(), image.pixels.end(), gray);
  return image;
}

/// Draws a tag upright with cells of whole pixels. @return the border's edge, pixels
inline int draw_tag(GrayImage& image, int id, int left, int top, int cell_px,
                    std::uint8_t black = 20, std::uint8_t white = 220) {
  const auto family = TagFamily::named("tag36h11").value();
  const auto cells = family.cells(id);
  for (int v = 0; v < family.width() * cell_px; ++v) {
    for (int u = 0; u < family.width() * cell_px; ++u) {
      const auto at = static_cast<std::size_t>(v / cell_px * family.width() + u / cell_px);
      image.pixels[static_cast<std::size_t>((top + v) * image.width + left + u)] =
          cells[at] == 0 ? black : white;
    }
  }
  return family.edge_width() * cell_px;
}

/// A dark square with nothing in it.
inline void draw_square(GrayImage& image, int left, int top, int side, std::uint8_t gray) {
  for (int v = top; v < top + side; ++v)
    for (int u = left; u < left + side; ++u)
      image.pixels[static_cast<std::size_t>(v * image.width + u)] = gray;
}

/// Averages over this number of pixels to the right (and, of a lens, down).
inline void blur(GrayImage& image, int across, int down = 1) {
  const GrayImage sharp = image;
  for (int v = 0; v + down <= image.height; ++v) {
    for (int u = 0; u + across <= image.width; ++u) {
      int sum = 0;
      for (int y = 0; y < down; ++y)
        for (int x = 0; x < across; ++x)
          sum += sharp.pixels[static_cast<std::size_t>((v + y) * image.width + u + x)];
      image.pixels[static_cast<std::size_t>(v * image.width + u)] =
          static_cast<std::uint8_t>(sum / (across * down));
    }
  }
}

}  // namespace fiducap
