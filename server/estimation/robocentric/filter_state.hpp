#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/filter/growing_covariance.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/filter/tag_measurement.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/start/place_search.hpp"

namespace fiducap::robocentric {

/// First row of each error block in the covariance. Every block is three wide.
namespace layout {
inline constexpr int kPosition = 0;  ///< p_WB_B, B axes, m.
inline constexpr int kVelocity = 3;  ///< v_WB_B, B axes, m/s.
inline constexpr int kAttitude = 6;  ///< q_WB = q̂_WB exp(δ), δ in B axes, rad.
inline constexpr int kBiasF = 9;     ///< accelerometer bias, m/s².
inline constexpr int kBiasW = 12;    ///< gyro bias, rad/s.
inline constexpr int kBodySize = 15;
/// Motion since the last image (X_B0B, B axes), only while propagating: right after the body.
inline constexpr int kStepPosition = 15;
inline constexpr int kStepAttitude = 18;
inline constexpr int kMotionSize = 21;

inline constexpr int kPoseSize = 6;
/// Camera c: p_BV (B axes) then rotation, q_BV = exp(δ) q̂_BV, δ in B axes.
[[nodiscard]] constexpr int extrinsics(int camera) { return kBodySize + kPoseSize * camera; }
/// Tag i: p_VT (V axes of camera 0) then rotation, q_VT = exp(δ) q̂_VT, δ in V axes.
[[nodiscard]] constexpr int tag(int cameras, int i) {
  return kBodySize + kPoseSize * (cameras + i);
}
}  // namespace layout

using BodyMatrix = Eigen::Matrix<double, layout::kBodySize, layout::kBodySize>;
using MotionMatrix = Eigen::Matrix<double, layout::kMotionSize, layout::kMotionSize>;
using MotionFromBody = Eigen::Matrix<double, layout::kMotionSize, layout::kBodySize>;
using Matrix3x6d = Eigen::Matrix<double, 3, 6>;

/// A tag in the state: `r_T`, `q_T` of RCARS.
struct LocalTag : TagRecord {
  Pose X_VT;  ///< In the axes of camera 0.
};

/// The state x of RCARS II-D3, for any number of tags and cameras: position and velocity of the
/// body in its own rotating axes B, tags in the axes of camera 0.
struct FilterMean {
  Instant time{};
  Eigen::Vector3d p_WB_B{Eigen::Vector3d::Zero()};
  Eigen::Vector3d v_WB_B{Eigen::Vector3d::Zero()};
  Eigen::Quaterniond q_WB{Eigen::Quaterniond::Identity()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
  std::vector<Pose> X_BV;      ///< One per camera.
  std::vector<LocalTag> tags;  ///< Order of entry.
};

/// The state with its covariance.
struct FilterState : FilterMean {
  GrowingCovariance covariance;

  [[nodiscard]] int cameras() const { return static_cast<int>(X_BV.size()); }
  [[nodiscard]] int size() const { return layout::tag(cameras(), static_cast<int>(tags.size())); }
  [[nodiscard]] int tag_at(std::size_t i) const {
    return layout::tag(cameras(), static_cast<int>(i));
  }
  [[nodiscard]] Pose X_WB() const { return {q_WB, q_WB * p_WB_B}; }

  /// size() × size(), symmetric.
  [[nodiscard]] auto P() { return covariance.live(); }
  [[nodiscard]] auto P() const { return covariance.live(); }

  /// Tags that are used but not corrected: none in RCARS.
  [[nodiscard]] std::span<const int> held_tags() const { return {}; }
  /// Index of a tag in `tags`, or -1.
  [[nodiscard]] int find(int tag_id) const { return find_tag(tags, tag_id); }
  /// Appends a tag, uncorrelated with the rest.
  void add_tag(const LocalTag& tag, const Matrix6d& own);
  /// Marginalises a tag.
  void remove_tag(std::size_t i);
  /// Copies all but the covariance.
  void copy_mean(const FilterState& other) { static_cast<FilterMean&>(*this) = other; }
  /// Sets the covariance to zero at size().
  void resize_covariance() { covariance.reset(size()); }

  /// x ⊞ δ, with δ of length size() as in `layout`.
  void add_error(const Eigen::Ref<const Eigen::VectorXd>& error);
  /// The error δ to another mean with the same tags: other = this ⊞ δ, first order in rotation.
  [[nodiscard]] Eigen::VectorXd error_to(const FilterState& other) const;
};

/// Pose, velocity and biases in workspace axes with their covariance.
[[nodiscard]] BodyEstimate body_in_workspace(const FilterState& state);

/// No effect: in camera and body axes a correction changes no lever arm.
inline void transport_covariance(FilterState& /*state*/,
                                 const Eigen::Ref<const Eigen::VectorXd>& /*correction*/,
                                 int /*camera*/) {}

/// The rotation R of a position and of an attitude error.
[[nodiscard]] inline Matrix6d turn_of_pose_error(const Eigen::Matrix3d& R) {
  Matrix6d out = Matrix6d::Zero();
  out.topLeftCorner<3, 3>() = out.bottomRightCorner<3, 3>() = R;
  return out;
}

/// Innovation and Jacobian of one tag, RCARS II-D4. A tag of the state seen by camera 0 depends on
/// itself alone; another camera adds both extrinsics; a known tag depends on the body.
[[nodiscard]] TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model,
                                     const TagToUse& tag, double corner_noise_px);

/// All tags of an image.
void measure_image(const FilterState& state, int camera, const CameraModel& model,
                   std::span<const TagToUse> tags, const CornerNoise& noise, ImageMeasurement& out);

/// Pose of a tag in the axes of `camera`, by the state's mean.
[[nodiscard]] Pose predicted_tag(const FilterState& state, int camera, const TagToUse& tag);

/// The tags of an image in the body axes B0 of the state, for find_place(), which then returns the
/// motion since.
[[nodiscard]] std::vector<SightedTag> tags_at_start(const FilterState& state, int camera,
                                                    const CameraModel& model,
                                                    std::span<const TagToUse> tags);

/// Adds a tag at its pose by the corners (RCARS II-D4). One step replaces the paper's large
/// covariance and update: the covariance of the least squares pose and, for cameras other than 0,
/// that of both extrinsics.
void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, double corner_noise_px);

/// Fuses a surveyed pose of a tag in the state as a measurement of X_WT.
void fuse_prior(FilterState& state, std::size_t tag, const KnownTag& prior);

/// A tag of the state in W, with its covariance (position, rotation vector, both W axes).
[[nodiscard]] KnownTag tag_in_workspace(const FilterState& state, std::size_t tag);

/// Redefines W by a tag in the state: its position and heading (`level`: the vertical comes from
/// gravity), or its whole pose, become exact. No measurable quantity changes.
/// @return X_WnewWold
Pose anchor_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level);

/// Redefines W by a known tag that `camera` sees at X_VT: position and heading (not `level`: the
/// whole attitude) are uncertain until the next update.
/// @return X_WnewWold
Pose anchor_to_known(FilterState& state, int camera, const Pose& X_VT, const Pose& X_WT,
                     bool level);

/// The same by a tag of the state, at its estimated pose.
Pose anchor_local_to_known(FilterState& state, std::size_t tag, const Pose& X_WT, bool level);

}  // namespace fiducap::robocentric
