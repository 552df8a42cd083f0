#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "base/time.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {

/// One image of one camera of a body.
struct CameraFrame {
  int camera{};          ///< Index among the body's cameras.
  Instant exposed_at{};  ///< Middle of the exposure, camera–IMU time shift already applied.
  std::shared_ptr<const GrayImage> image;
  /// So much of `exposed_at` is what the body's filter learned about the clock
  /// (SampleMerger::set_clock_shift).
  Duration clock_shift{0};
  /// Images since the one before this that were taken and did not come, or came damaged; as far as
  /// the source can tell.
  std::uint32_t lost_before{0};
};

/// How one side of a tag showed.
struct TagSide {
  /// As TagSighting's. 0 when it was smeared and could not be fitted, or, of all four, when the
  /// source does not say.
  double sharpness{};
  double clipped{};  ///< Share of white beside it (or beyond, if narrow) at the sensor's end.
};

/// One tag found in one image, before the lens is taken out.
struct TagSighting {
  int tag_id{};
  int hamming{};             ///< Corrected bits.
  double decision_margin{};  ///< Contrast of the decoded bits, 0..255; higher is safer. 0 when the
                             ///< source has none.
  /// Raw (distorted) pixels, (0, 0) = *centre* of the upper-left pixel.
  /// Bottom-left, bottom-right, top-right, top-left of the printed tag.
  std::array<Eigen::Vector2d, 4> corners_px{};
  /// How much of the step from black to white at the blurriest side falls within two pixels: 1 is
  /// sharp, 0 when the source does not say.
  double sharpness{};
  std::array<TagSide, 4> sides{};  ///< From each corner to the next.
};

/// One followed image point in one image, before the lens is taken out. What it shows is
/// unknown.
struct PointSighting {
  std::uint32_t track{};  ///< The same in every image that shows the point; never used again.
  int age{};              ///< Reports of this track before this one.
  Eigen::Vector2d px{Eigen::Vector2d::Zero()};  ///< Raw (distorted) pixel.
};

/// The tags of one image: what a detector makes of a CameraFrame, or what a recording or a robot
/// with a detector of its own delivers instead of images. `tags` may be empty: the image was there,
/// no tag was.
struct CornerFrame {
  int camera{};
  Instant exposed_at{};
  std::vector<TagSighting> tags;
  /// The corners are where straight lines fitted to the tag's sides meet (libapriltag). A lens
  /// bends the sides, so such corners are off in a way that the lens model tells; `observe` takes
  /// it out.
  bool fitted_straight_sides{false};
  double pixel_noise{};  ///< 1-sigma of the image's pixels, of 255; 0 when the source does not say.
  Duration clock_shift{0};  ///< As in CameraFrame.
  /// Sorted by track; empty when points are not followed, and in images between their reports.
  std::vector<PointSighting> points{};
};

}  // namespace fiducap
