#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "estimation/segment/motion_segment.hpp"

namespace fiducap {

/// Where the numbers of a SegmentFactor stand.
namespace segment_layout {
inline constexpr int kBegin = 0;  ///< As world::layout has a body.
inline constexpr int kEnd = 15;
inline constexpr int kCameraSize = 12;
/// Camera c: e of X_BV = Exp(e) X̂_BV, then clock, readout, focal length, centre, distortion as in
/// world::layout.
[[nodiscard]] constexpr int camera(int c) { return 30 + kCameraSize * c; }
/// Where these stand in it.
inline constexpr int kClock = 6;
inline constexpr int kReadout = 7;
inline constexpr int kFocal = 8;
inline constexpr int kCentre = 9;
inline constexpr int kDistortion = 11;
/// Tag i: as in world::layout, then the scale of its print, relative.
inline constexpr int kTagSize = 7;
[[nodiscard]] constexpr int tag(int cameras, int i) { return camera(cameras) + kTagSize * i; }
[[nodiscard]] constexpr int scale(int cameras, int i) { return tag(cameras, i) + 6; }
/// Last, where there is an IMU: how much more gravity is than the sensors say, m/s².
[[nodiscard]] constexpr int gravity(int cameras, int tags) { return tag(cameras, tags); }
}  // namespace segment_layout

/// What a whole segment says of where the body was at its two ends, of its cameras, of the tags
/// that it saw and of gravity: the body's path between is taken out (Schur complement). To second
/// order around where it was linearised, in errors on the world's side; a common shift of all of
/// it, and a turn about the vertical when there is an IMU, a turn about any axis when there is
/// none, changes nothing.
///
///     cost(ξ) = ½ ξᵀ H ξ + gᵀ ξ + cost
struct SegmentFactor {
  /// Linearised here, in axes parallel to W whose origin is where the body began.
  BodyMoment begin;
  BodyMoment end;
  std::vector<CameraBelief> cameras;
  std::vector<KnownTag> tags;
  std::vector<double> scales;
  double gravity_offset_m_s2{};
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  double cost{};
  int numbers{};  ///< Corner coordinates in it.
  int sightings{};
  int outliers{};  ///< Sightings that pull at less than half their weight.
};

/// Least squares over all images and readings of the segment, ends, cameras and tags held where the
/// segment has them. Moves its instances between to where they fit best, in W axes.
/// One without tags and images only says how the body moved.
/// @return nullopt when the numbers are not finite, or images show no tag of the segment
[[nodiscard]] std::optional<SegmentFactor> condense(MotionSegment& segment);

/// How well an instance between the ends is known: its error is by_rest times that of the rest (in
/// the order of segment_layout) and something of its own. About where the segment begins, on the
/// world's side.
struct PathPoint {
  Eigen::Matrix<double, 15, 15> given;  ///< Covariance when ends, cameras and tags are known.
  Eigen::MatrixXd by_rest;
};

/// The same for whoever asks where the body was: moves the instances between to where they fit
/// best.
/// @return of each of them; empty where condense() gives nothing, or there are none
[[nodiscard]] std::vector<PathPoint> path_between(MotionSegment& segment);

}  // namespace fiducap
