#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimation/segment/motion_segment.hpp"

namespace fiducap {

/// Order of the numbers of a SegmentFactor.
namespace segment_layout {
inline constexpr int kBegin = 0;  ///< As world::layout has a body.
inline constexpr int kEnd = 15;
inline constexpr int kCameraSize = 12;
/// Camera c: e of X_BV = Exp(e) X̂_BV, then clock, readout, focal length, centre, distortion as in
/// world::layout.
[[nodiscard]] constexpr int camera(int c) { return 30 + kCameraSize * c; }
/// Offsets within a camera.
inline constexpr int kClock = 6;
inline constexpr int kReadout = 7;
inline constexpr int kFocal = 8;
inline constexpr int kCentre = 9;
inline constexpr int kDistortion = 11;
/// Tag i: as in world::layout, then its relative size.
inline constexpr int kTagSize = 7;
[[nodiscard]] constexpr int tag(int cameras, int i) { return camera(cameras) + kTagSize * i; }
[[nodiscard]] constexpr int scale(int cameras, int i) { return tag(cameras, i) + 6; }
/// Last, with an IMU: gravity minus the configured value, m/s².
[[nodiscard]] constexpr int gravity(int cameras, int tags) { return tag(cameras, tags); }
}  // namespace segment_layout

/// Information of a segment about the body at its two ends, its cameras, the tags seen and gravity,
/// with the path between eliminated (Schur complement). Second order around the linearisation
/// point, in errors on the world's side. Invariant to a common shift and to a common rotation:
/// about the vertical with an IMU, about any axis without.
///
///     cost(ξ) = ½ ξᵀ H ξ + gᵀ ξ + cost
struct SegmentFactor {
  /// Linearisation point, in axes parallel to W with origin at the body's begin.
  BodyMoment begin;
  BodyMoment end;
  std::vector<CameraBelief> cameras;
  std::vector<KnownTag> tags;
  std::vector<double> scales;
  double gravity_offset_m_s2{};
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  double cost{};
  int numbers{};  ///< Corner coordinates.
  int sightings{};
  int outliers{};  ///< Sightings with less than half their weight.
};

/// Least squares over all images and IMU samples of the segment, with ends, cameras and tags at the
/// segment's values. Moves its inner instances to their solution, in W axes. Without tags and
/// images only the motion is used.
/// @return nullopt: not finite, or no image shows a tag of the segment
[[nodiscard]] std::optional<SegmentFactor> condense(MotionSegment& segment);

/// Covariance of an inner instance: its error is by_rest times that of the rest (in the order of
/// segment_layout) plus its own. About the segment's begin, on the world's side.
struct PathPoint {
  Eigen::Matrix<double, 15, 15> given;  ///< Covariance given ends, cameras and tags.
  Eigen::MatrixXd by_rest;
};

/// The same for the path: moves the inner instances to their solution.
/// @return one per inner instance; empty where condense() returns nullopt
[[nodiscard]] std::vector<PathPoint> path_between(MotionSegment& segment);

}  // namespace fiducap
