#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/gravity.hpp"
#include "base/time.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/recording.hpp"

namespace fiducap::bound {

using Matrix8 = Eigen::Matrix<double, 8, 8>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

/// Errors of a tag's corners that fade while it is in view, first-order Gauss–Markov.
struct LastingErrors {
  double fades_s{};                              ///< Until 1/e of them is left.
  Duration visit_ends{std::chrono::seconds(1)};  ///< Unseen for this time: other errors.
};

/// One tag in an image.
struct TagSight {
  int tag_id{};
  Matrix8 whiten;                    ///< Its raw coordinates times this have unit white noise …
  Matrix8 lasting{Matrix8::Zero()};  ///< … and these, by eight unit errors that last.
};

/// Prior knowledge and noise of the sensors.
struct BoundProblem {
  CameraMount camera;  ///< True place; its sigmas are the prior (per axis) of cases A and C.
  ImuNoise imu;
  double gravity_m_s2{kUsualGravity_m_s2};
  double corner_noise_px{0.4};    ///< Per coordinate, raw pixels.
  std::vector<RecordedTag> tags;  ///< True poses.
  int reference_tag{};
  bool map_known{};         ///< Cases C and D.
  bool extrinsics_known{};  ///< Cases B and D.
  std::optional<LastingErrors> lasting{};
};

/// Roots of traces of covariances: the RMS of the three components' joint error.
struct BoundAt {
  Instant at{};
  double position_m{};  ///< In the reference tag's axes.
  double rotation_rad{};
  double level_position_m{};  ///< In level axes at the reference tag: its place and heading only.
  double level_rotation_rad{};
  double velocity_m_s{};  ///< Body axes.
  double camera_m{};      ///< The camera's place, in the reference tag's axes.
};

/// RMS over the tags, in the reference tag's axes.
struct MapBound {
  double position_m{};
  double rotation_rad{};
};

/// Joint covariance of tags: errors of place and rotation (6 numbers each, m and rad, axes of the
/// true poses), one tag after the other.
struct TagsCovariance {
  std::vector<int> ids;  ///< Ascending.
  Eigen::MatrixXd P;
};

}  // namespace fiducap::bound
