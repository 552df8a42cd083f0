#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "base/time.hpp"

namespace fiducap {

/// What a line fitted to a side of a tag is off, 1-sigma, raw pixels.
struct SideSigma {
  double shift_px{};  ///< As a whole, across itself.
  double turn_px{};   ///< Its ends against its middle.
};

/// One AprilTag seen in one image, lens taken out.
struct TagObservation {
  int tag_id{};
  int hamming{};
  double decision_margin{};  ///< 0..255; higher is safer. 0 = the source did not say.
  double edge_m{};           ///< Edge of the printed black border of this id.
  /// Ideal pinhole pixels (fu fv cu cv of the camera). Counter-clockwise, lower-left of the tag
  /// first.
  std::array<Eigen::Vector2d, 4> corners_px{};
  /// Per corner ∂ ideal / ∂ raw: noise is white in raw pixels, this carries it through the lens.
  std::array<Eigen::Matrix2d, 4> ideal_from_raw{};
  std::array<Eigen::Vector2d, 4> raw_px{};  ///< As they stand in the image, lens and all.
  /// Raw row of each corner, −0.5 at the first … +0.5 at the last row of the image: a rolling
  /// shutter exposes them in turn.
  std::array<double, 4> rows{};
  /// 1-sigma of each coordinate of each corner in *raw* pixels, as far as the detector causes it
  /// (see corner_sigma_px). 0: not known, take EstimatorConfig::corner_noise_px.
  double corner_sigma_px{};
  /// The same said apart, for each side (from each corner to the next); a corner is where two of
  /// them meet (corner_covariance.hpp). Zeros: not known.
  std::array<SideSigma, 4> sides{};

  [[nodiscard]] bool knows_sides() const { return sides[0].shift_px > 0; }
};

/// One followed image point in one image, lens taken out (PointSighting).
struct PointObservation {
  std::uint32_t track{};
  int age{};
  Eigen::Vector2d px{Eigen::Vector2d::Zero()};                  ///< Ideal pinhole pixel.
  Eigen::Matrix2d ideal_from_raw{Eigen::Matrix2d::Identity()};  ///< ∂ ideal / ∂ raw
};

/// All usable tags of one image, sorted by id, ids unique. Empty is a normal answer.
struct TagObservations {
  int camera{};
  Instant exposed_at{};
  Duration clock_shift{
      0};  ///< So much of `exposed_at` was added by what the filter learned (see CameraFrame).
  std::vector<TagObservation> tags;
  std::vector<PointObservation> points;  ///< Sorted by track.
};

}  // namespace fiducap
