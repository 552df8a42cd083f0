#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "base/time.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {

constexpr int kMostCameras = 16;  ///< Of one body.

struct CameraFrame {
  int camera{};          ///< Index among the body's cameras.
  Instant exposed_at{};  ///< Middle of the exposure, camera–IMU time shift already applied.
  std::shared_ptr<const GrayImage> image;
  /// Part of `exposed_at`: the clock offset by the filter (SampleMerger::set_clock_shift).
  Duration clock_shift{0};
  /// Images lost or damaged since the one before this, as far as the source knows.
  std::uint32_t lost_before{0};
};

/// Sharpness of one side of a tag.
struct TagSide {
  /// As TagSighting's. 0: blurred and not fitted; of all four: not known.
  double sharpness{};
  double clipped{};  ///< Share of white beside it (or beyond, if narrow) that is saturated.
};

/// One tag found in one image, distorted.
struct TagSighting {
  int tag_id{};
  int hamming{};             ///< Corrected bits.
  double decision_margin{};  ///< Contrast of the decoded bits, 0..255; higher is safer. 0: none.
  /// Raw (distorted) pixels, (0, 0) = *centre* of the upper-left pixel.
  /// Bottom-left, bottom-right, top-right, top-left of the printed tag.
  std::array<Eigen::Vector2d, 4> corners_px{};
  /// Share of the black-white step within two pixels, at the blurriest side; 1: sharp, 0: unknown.
  double sharpness{};
  std::array<TagSide, 4> sides{};  ///< From each corner to the next.
};

/// One tracked image point in one image, distorted.
struct PointSighting {
  std::uint32_t track{};                        ///< Id of the point in all images; never reused.
  int age{};                                    ///< Reports of this track before this one.
  Eigen::Vector2d px{Eigen::Vector2d::Zero()};  ///< Raw (distorted) pixel.
};

/// The tags of one image, from our detector, a recording or a robot that detects tags. May be none.
struct CornerFrame {
  int camera{};
  Instant exposed_at{};
  std::vector<TagSighting> tags;
  /// Corners are intersections of straight lines fitted to the tag's sides (libapriltag). The lens
  /// bends the sides, so such corners are biased; `observe` corrects that by the lens model.
  bool fitted_straight_sides{false};
  double pixel_noise{};     ///< 1-sigma of the image's pixels, of 255; 0: not known.
  Duration clock_shift{0};  ///< As in CameraFrame.
  /// Sorted by track; empty when points are not tracked, and in images between their reports.
  std::vector<PointSighting> points{};
};

}  // namespace fiducap
