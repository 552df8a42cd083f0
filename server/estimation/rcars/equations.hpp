#pragma once

#include <Eigen/Core>
#include <span>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_geometry.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/rcars/state.hpp"

namespace fiducap::rcars {

/// Jacobian of one step of the body by its error and by white noise of gyroscope and accelerometer.
struct BodyStep {
  BodyMatrix F{BodyMatrix::Identity()};
  Eigen::Matrix<double, kBodySize, 3> G_w;
  Eigen::Matrix<double, kBodySize, 3> G_f;
};

/// Moves r, v and q over dt (II-D3). Instead of Euler's rule the rotation is exact and the force is
/// rotated by half of it (mid-point rule): the noise of the IMU needs no inflation.
/// @param g_W  (0, 0, -9.81)
BodyStep step_body(State& x, const InertialInput& imu, const Eigen::Vector3d& g_W, double dt);

/// Prediction from one image to the next (II-D3): the body moves with every IMU sample; tags and P
/// move once, by the motion since the last image.
class Prediction final {
 public:
  explicit Prediction(const State& x) : X_B0W_(x.X_BW().X) {}
  void step(State& x, const InertialInput& imu, const Eigen::Vector3d& g_W, double dt);
  /// Moves tags and P, once after all steps.
  void finish(State& x);

 private:
  Pose X_B0W_;  ///< At the last image.
  BodyMatrix Phi_{BodyMatrix::Identity()};
  BodyMatrix Q_{BodyMatrix::Zero()};
};

/// A tag of an image with a pose: in the state or, when `known` is set, given.
struct Sighting {
  const TagObservation* seen{};
  const KnownTag* known{};
};

/// Innovation y of one tag (II-D4): four corners, measured minus predicted, raw pixels.
struct Innovation {
  Vector8d y{Vector8d::Zero()};
  /// y = H δ + n
  std::vector<std::pair<int, Matrix86d>> H;
  Matrix8d R{Matrix8d::Zero()};  ///< R_p and the covariance of a known pose.
  bool in_front{true};           ///< False: a corner lies behind the camera.
};

/// One camera, with the noise n_p of its corners.
struct View {
  int camera{};
  const CameraModel& model;
  double noise_px{};
};

[[nodiscard]] Innovation innovation(const State& x, const View& view, const Sighting& tag);

/// Update with all tags of an image that pass the gate, jointly.
/// @param gate      limit of each tag's Mahalanobis distance
/// @return per tag, whether it was used
std::vector<bool> update(State& x, const View& view, std::span<const Sighting> tags, double gate,
                         UpdateReport& report);

/// Augmentation with a new tag (II-D4), seen at X_VT by the view's camera. The covariance of that
/// least squares pose replaces the paper's large one and its first update.
void augment(State& x, const View& view, const TagObservation& seen, const Pose& X_VT);

/// Fuses a surveyed pose of a tag of the state.
void fuse_prior(State& x, std::size_t tag, const KnownTag& prior);

/// Redefines W by a tag of the state (II-D1: gravity is vertical): position and heading of the tag
/// become exact. No measurable quantity changes.
/// @return X_WnewWold
Pose define_by_reference(State& x, std::size_t tag, const HeadingRule& rule);

/// Redefines W by a known tag that a camera sees at X_VT: position and heading are uncertain until
/// the next update.
/// @return X_WnewWold
Pose define_by_known(State& x, int camera, const Pose& X_VT, const Pose& X_WT);

}  // namespace fiducap::rcars
