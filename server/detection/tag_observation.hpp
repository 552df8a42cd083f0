#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "base/time.hpp"

namespace fiducap {

/// Corners of a tag in an image: bottom-left, bottom-right, top-right, top-left of the print.
using TagCorners = std::array<Eigen::Vector2d, 4>;

/// Error of a line fitted to a side of a tag, 1-sigma, raw pixels.
struct SideSigma {
  double shift_px{};  ///< Of the whole side, across it.
  double turn_px{};   ///< Of its ends against its middle.
};

/// One AprilTag seen in one image, undistorted.
struct TagObservation {
  int tag_id{};
  int hamming{};
  double decision_margin{};  ///< 0..255; higher is safer. 0: unknown.
  double edge_m{};           ///< Edge of the printed black border of this id.
  TagCorners corners_px{};   ///< Ideal pinhole pixels (fu fv cu cv of the camera).
  /// Per corner ∂ ideal / ∂ raw: noise is white in raw pixels, this carries it through the lens.
  std::array<Eigen::Matrix2d, 4> ideal_from_raw{};
  TagCorners raw_px{};  ///< Distorted.
  /// Raw row of each corner, −0.5 at the first … +0.5 at the last row of the image: a rolling
  /// shutter exposes the rows in turn.
  std::array<double, 4> rows{};
  /// 1-sigma of each coordinate of each corner in *raw* pixels, detector errors only
  /// (corner_sigma_px). 0: unknown, use EstimatorConfig::corner_noise_px.
  double corner_sigma_px{};
  /// The same per side (from each corner to the next); a corner is the intersection of two sides
  /// (corner_covariance). Zeros: unknown.
  std::array<SideSigma, 4> sides{};

  [[nodiscard]] bool knows_sides() const { return sides[0].shift_px > 0; }
};

/// One tracked image point in one image, undistorted (PointSighting).
struct PointObservation {
  std::uint32_t track{};
  int age{};
  Eigen::Vector2d px{Eigen::Vector2d::Zero()};                  ///< Ideal pinhole pixel.
  Eigen::Matrix2d ideal_from_raw{Eigen::Matrix2d::Identity()};  ///< ∂ ideal / ∂ raw
};

/// All usable tags of one image, sorted by id, ids unique. May be empty.
struct TagObservations {
  int camera{};
  Instant exposed_at{};
  Duration clock_shift{0};  ///< As in CameraFrame.
  std::vector<TagObservation> tags;
  std::vector<PointObservation> points;  ///< Sorted by track.
};

}  // namespace fiducap
