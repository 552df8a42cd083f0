#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/gravity.hpp"
#include "base/pose.hpp"
#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/lens/lens_offset.hpp"
#include "detection/corner_covariance.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/imu/inertial_input.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// A body at one instant.
struct BodyMoment {
  Instant at{};
  Pose X_WB;
  Eigen::Vector3d v_WB{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
};

/// What is known of a body before any image.
struct SegmentSensors {
  std::vector<CameraMount> cameras;
  bool has_imu{true};
  double gravity_m_s2{kUsualGravity_m_s2};
  bool estimates_extrinsics{true};
  bool estimates_clocks{true};
  bool doubts{false};            ///< Lenses, readouts and prints may be other ones than configured.
  double gravity_sigma_m_s2{0};  ///< 0: exact.
};

/// A camera on a body as it is thought to be. What is learned of it holds for a whole segment.
struct CameraBelief {
  Pose X_BV;
  double shift_s{};  ///< t_imu = stamp + shift, beyond what is configured …
  double readout_s{};
  bool rows_apart{};  ///< The rows are exposed in turn.
  LensOffset lens;
  bool lens_is_open{};  ///< It was found to be another one than configured.
};

/// One tag in one image.
struct SegmentSighting {
  TagObservation seen;
  double noise_px{};  ///< 1-sigma of each coordinate, when they are alike.
  bool is_even{true};
  Matrix8d covariance;  ///< Else.
};

/// An image with its tags.
struct SegmentImage {
  int camera{};
  double applied_s{};  ///< So much of the clock's shift is in the moment's time.
  double jitter_s{};   ///< 1-sigma by which its stamp is off on its own.
  std::vector<SegmentSighting> tags;
};

/// An inertial reading and for how long it holds.
struct SegmentStep {
  InertialInput input;
  double dt_s{};
};

/// All that one body saw and felt between two instants, and what its filter made of it: raw, so
/// that it can be linearised anew when more is known. The unit in which a body tells the map graph
/// what it knows; each reading and each corner is in one segment.
struct MotionSegment {
  /// The body at an instant with images, as the filter had it, and what led there from the one
  /// before.
  struct Instance {
    BodyMoment body;
    std::vector<SegmentStep> steps;  ///< None in the first one.
    std::vector<SegmentImage> images;
  };

  int body_id{};
  /// Segments of one chain hang together: each begins where the one before ends.
  int chain{};
  bool anchored{};  ///< Axes W are those of the workspace. False: the body's own.
  /// What is up where it begins, in the body's axes, as odometry knows it: of a chain's first one.
  std::optional<Eigen::Vector3d> up_B;
  std::shared_ptr<const SegmentSensors> sensors;
  std::vector<Instance> instances;    ///< First: where it begins (only a chain's first one has
                                      ///< images there), last: where it ends.
  std::vector<CameraBelief> cameras;  ///< All of the body's.
  double gravity_offset_m_s2{};       ///< How much more gravity is than the sensors say.
  std::vector<KnownTag> tags;         ///< Where the filter, or the map, has the tags seen.
  std::vector<double> scales;         ///< Of each: its print is so much larger than told, relative;
                                      ///< empty: all are as told.

  [[nodiscard]] bool has_imu() const { return sensors->has_imu; }
  [[nodiscard]] const BodyMoment& begin() const { return instances.front().body; }
  [[nodiscard]] const BodyMoment& end() const { return instances.back().body; }
};

}  // namespace fiducap
