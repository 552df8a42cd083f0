#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/gravity.hpp"
#include "base/pose.hpp"
#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_geometry.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// State of a body at one instant.
struct BodyMoment {
  Instant at{};
  Pose X_WB;
  Eigen::Vector3d v_WB{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
};

/// Configuration of a body's sensors.
struct SegmentSensors {
  std::vector<CameraMount> cameras;
  bool has_imu{true};
  double gravity_m_s2{kUsualGravity_m_s2};
  bool estimates_extrinsics{true};
  bool estimates_clocks{true};
  double gravity_sigma_m_s2{0};  ///< 0: exact.
};

/// Estimated calibration of a camera, constant over a segment.
struct CameraBelief {
  Pose X_BV;
  double shift_s{};  ///< t_imu = stamp + shift, beyond the configured shift.
  double readout_s{};
  bool rows_apart{};  ///< Rolling shutter.
  LensOffset lens;
  bool lens_is_open{};  ///< The lens differs from the configured one.
};

/// One tag in one image.
struct SegmentSighting {
  TagObservation seen;
  double noise_px{};  ///< 1-sigma of each coordinate, when `is_even`.
  bool is_even{true};
  Matrix8d covariance;  ///< When not `is_even`.
};

/// An image with its tags.
struct SegmentImage {
  int camera{};
  double applied_s{};  ///< Part of the clock's shift that is in the instant.
  double jitter_s{};   ///< Independent error of its stamp, 1-sigma.
  std::vector<SegmentSighting> tags;
};

/// An inertial input and its duration.
struct SegmentStep {
  InertialInput input;
  double dt_s{};
};

/// All measurements of one body between two instants, with its filter's estimate. Measurements are
/// raw: the map graph can linearise them again. Each sample and each corner is in one segment.
struct MotionSegment {
  /// An instant with images: the filter's estimate and the steps from the previous instance.
  struct Instance {
    BodyMoment body;
    std::vector<SegmentStep> steps;  ///< None in the first one.
    std::vector<SegmentImage> images;
  };

  int body_id{};
  /// In a chain each segment begins at the end of the previous one.
  int chain{};
  bool anchored{};  ///< W is the workspace. False: the body's own axes.
  /// Vertical at the beginning by odometry, B axes; of the first segment of a chain.
  std::optional<Eigen::Vector3d> up_B;
  std::shared_ptr<const SegmentSensors> sensors;
  std::vector<Instance> instances;    ///< From begin (images only in a chain's first one) to end.
  std::vector<CameraBelief> cameras;  ///< All of the body's.
  double gravity_offset_m_s2{};       ///< Gravity minus the configured value.
  ImuIntrinsics imu{};                ///< As estimated by the filter; constant.
  std::vector<FoundMismatch> found;   ///< Differences from the configuration, by the filter.
  std::vector<KnownTag> tags;         ///< Tags seen, by the filter or the map.
  std::vector<double> scales;         ///< Relative size offset of each tag; empty: none.

  [[nodiscard]] bool has_imu() const { return sensors->has_imu; }
  [[nodiscard]] const BodyMoment& begin() const { return instances.front().body; }
  [[nodiscard]] const BodyMoment& end() const { return instances.back().body; }
};

/// Removes the sightings for which `is_out` is true, and images and tags that have no other.
void remove_sightings(MotionSegment& segment,
                      const std::function<bool(const MotionSegment::Instance&, const SegmentImage&,
                                               const SegmentSighting&)>& is_out);

using Vector15d = Eigen::Matrix<double, 15, 1>;

/// body ⊞ error, on the world's side in the order of world::layout: X = Exp(ξ) X̂, v = exp(φ) v̂ +
/// J_l(φ) ν, biases additive.
[[nodiscard]] BodyMoment moved(const BodyMoment& body, const Vector15d& error);
/// The error between two: to = from ⊞ error.
[[nodiscard]] Vector15d error_between(const BodyMoment& from, const BodyMoment& to);
/// The body in other axes: X ← G X.
[[nodiscard]] BodyMoment in_other_axes(const Pose& G, const BodyMoment& body);
/// J_l(ξ)⁻¹ of SE(3): derivative of ξ by a further small error on the world's side. Barfoot, State
/// Estimation for Robotics, 7.83.
[[nodiscard]] Matrix6d inverse_left_jacobian(const Vector6d& error);

}  // namespace fiducap
