#pragma once

#include <Eigen/Core>

#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/recording.hpp"

namespace fiducap::bound {

/// Rows of the error blocks. All rotations are errors in W axes, q = exp(φ) q̂, except the
/// extrinsics' (B axes).
inline constexpr int kRotation = 0;
inline constexpr int kVelocity = 3;
inline constexpr int kPosition = 6;
inline constexpr int kBiasW = 9;
inline constexpr int kBiasF = 12;
inline constexpr int kBody = 15;
inline constexpr int kExtrinsicsP = 15;  ///< p_BV, B axes.
inline constexpr int kExtrinsicsQ = 18;  ///< q_BV = exp(φ) q̂_BV.
inline constexpr int kFirstTag = 21;     ///< From here 6 per tag: p_WT, then rotation.

using Matrix15 = Eigen::Matrix<double, 15, 15>;

/// One inertial step along the truth: error transition and the noise that it adds.
struct InertialStep {
  Matrix15 Phi;
  Matrix15 Q;
};

/// White noise and bias walk of continuous density over the step from one true state to the next;
/// the specific force is what leads from one true velocity to the next.
[[nodiscard]] InertialStep inertial_step(const TruthSample& from, const TruthSample& to,
                                         const ImuNoise& noise, double gravity_m_s2);

/// Eight raw pixel coordinates of one tag by the errors, divided by the pixel noise: rows have unit
/// noise.
struct CornerRows {
  Eigen::Matrix<double, 8, 3> rotation;  ///< Body attitude.
  Eigen::Matrix<double, 8, 3> position;  ///< Body position.
  Eigen::Matrix<double, 8, 6> extrinsics;
  Eigen::Matrix<double, 8, 6> tag;
};

/// @pre all corners in front of the camera and inside what the lens model can undo
[[nodiscard]] CornerRows corner_rows(const Pose& X_WB, const CameraMount& camera,
                                     const RecordedTag& tag, double noise_px);

/// Pose of the body in the axes of a tag by the errors (columns: rotation, position, of the body;
/// position, rotation of the tag); rows: position (tag axes), rotation (turned into tag axes).
using RelativeRows = Eigen::Matrix<double, 6, 12>;
[[nodiscard]] RelativeRows relative_to_tag(const Pose& X_WB, const Pose& X_WT);

/// The same in level axes: z up, origin in the tag, heading that of the tag's axis `axis`. Rows in
/// W axes.
[[nodiscard]] RelativeRows relative_to_level(const Pose& X_WB, const Pose& X_WT, int axis);

/// Heading of a tag's axis `axis` by the tag's rotation error (W axes).
[[nodiscard]] Eigen::RowVector3d heading_row(const Eigen::Quaterniond& q_WT, int axis);

/// Axis of a tag that gives level axes their heading: the first that is not steep, as in the
/// filters.
[[nodiscard]] int heading_axis(const Eigen::Quaterniond& q_WT);

}  // namespace fiducap::bound
