#pragma once

#include <array>
#include <cmath>
#include <memory>

#include "capture/camera_frame.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {

/// A printed tag before a camera that looks at it from the front: every pixel is the mean over its
/// area, nothing is blurred and nothing noisy.
struct PrintedTag {
  // Multiples of a quarter of a pixel, the resolution of the average.
  double cell_px{9.25};
  Eigen::Vector2d offset_px{0.25, 0.5};  ///< Of the paper's upper-left corner, in its pixel.
  int quarter_turns{0};                  ///< Of the print, clockwise.
  bool mirrored{false};
};

/// White paper around the print, cells.
inline constexpr int kPaper = 2;

/// Row and column of the print that lie at this place of the turned one, in its cells.
inline Eigen::Vector2d place_in_print(Eigen::Vector2d at, int width, const PrintedTag& tag) {
  for (int k = 0; k < tag.quarter_turns; ++k) at = {at.y(), width - at.x()};
  if (tag.mirrored) at.x() = width - at.x();
  return at;
}

inline std::shared_ptr<const GrayImage> photograph(const TagFamily& family, int id,
                                                   const PrintedTag& tag) {
  constexpr int kFine = 4;  // places of a pixel, along both of its sides
  const std::vector<std::uint8_t> cells = family.cells(id);
  const int width = family.width();
  const auto image = std::make_shared<GrayImage>();
  const int size = static_cast<int>(std::ceil((width + 2 * kPaper) * tag.cell_px)) + 1;
  image->resize(size, size);
  const auto gray_at = [&](const Eigen::Vector2d& px) {
    const Eigen::Vector2d turned =
        (px - tag.offset_px) / tag.cell_px - Eigen::Vector2d::Constant(kPaper);
    const Eigen::Vector2d at = place_in_print(turned, width, tag);
    if (at.minCoeff() < 0 || at.maxCoeff() >= width) return 220.0;
    const auto cell =
        static_cast<std::size_t>(static_cast<int>(at.y()) * width + static_cast<int>(at.x()));
    return cells[cell] != 0 ? 220.0 : 30.0;
  };
  for (int k = 0; k < size * size; ++k) {
    double sum = 0;
    for (int fine = 0; fine < kFine * kFine; ++fine) {
      const Eigen::Vector2d within(fine % kFine + 0.5, fine / kFine + 0.5);
      sum += gray_at(Eigen::Vector2d(k % size, k / size) + within / kFine);
    }
    image->pixels[static_cast<std::size_t>(k)] =
        static_cast<std::uint8_t>(std::lround(sum / (kFine * kFine)));
  }
  return image;
}

/// Bottom-left, bottom-right, top-right, top-left of the print, where they are in the image.
inline std::array<Eigen::Vector2d, 4> corners_of(const TagFamily& family, const PrintedTag& tag) {
  constexpr double kEdgeToCentre_px = 0.5;
  const double low = 0.5 * (family.width() - family.edge_width());
  const double high = low + family.edge_width();
  std::array<Eigen::Vector2d, 4> corners{{{low, high}, {high, high}, {high, low}, {low, low}}};
  for (Eigen::Vector2d& at : corners) {
    for (int k = 0; k < tag.quarter_turns; ++k) at = {family.width() - at.y(), at.x()};
    at = (at + Eigen::Vector2d::Constant(kPaper)) * tag.cell_px + tag.offset_px -
         Eigen::Vector2d::Constant(kEdgeToCentre_px);
  }
  return corners;
}

}  // namespace fiducap
