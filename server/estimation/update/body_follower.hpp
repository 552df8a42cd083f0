#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/filter/tag_measurement.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/start/place_search.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/start/tag_candidates.hpp"
#include "estimation/update/jump_search.hpp"

namespace fiducap {

enum class FilterMode {
  kStarting,  ///< No tags yet, no pose.
  kLost,      ///< Tags and workspace are known, the motion since then is not.
  kRunning,
};

/// Propagates the body: by the IMU's samples or, without IMU, by white noise acceleration and
/// angular acceleration, linearised at the motion shown by the tags of each image. Tracks the
/// attitude while there is no pose.
template <class Coordinates>
class BodyFollower final {
 public:
  BodyFollower(BodySensors sensors, const EstimatorConfig& config)
      : sensors_(std::move(sensors)),
        config_(config),
        coordinates_(sensors_, config_),
        imu_(sensors_.imu.value_or(ImuNoise{}), config.max_imu_gap_s,
             config.motion_accel_m_s2_rtHz) {
    FIDUCAP_ASSERT(!sensors_.cameras.empty());
  }
  BodyFollower(const BodyFollower&) = delete;
  BodyFollower& operator=(const BodyFollower&) = delete;

  [[nodiscard]] Coordinates& coordinates() { return coordinates_; }
  [[nodiscard]] const Coordinates& coordinates() const { return coordinates_; }
  [[nodiscard]] const BodySensors& sensors() const { return sensors_; }
  [[nodiscard]] const EstimatorConfig& config() const { return config_; }
  [[nodiscard]] bool has_imu() const { return sensors_.imu.has_value(); }
  [[nodiscard]] FilterMode mode() const { return mode_; }
  [[nodiscard]] bool is_running() const { return mode_ == FilterMode::kRunning; }
  [[nodiscard]] const CameraModel& model_of(int camera) const {
    FIDUCAP_ASSERT(camera >= 0 && camera < static_cast<int>(sensors_.cameras.size()));
    return sensors_.cameras[static_cast<std::size_t>(camera)].model;
  }
  [[nodiscard]] bool knows_attitude() const { return !has_imu() || attitude_.ready(); }
  [[nodiscard]] const ImuBuffer::RangesMet& ranges_met() const { return imu_.ranges_met(); }
  /// While lost: the rotation since then is not known by the gyroscope.
  [[nodiscard]] bool is_turn_lost() const { return is_turn_lost_; }

  void reset(const ClockHypothesis& clocks) {
    jump_search_.forget_all();
    instant_.clear();
    coordinates_.reset(clocks);
    mode_ = FilterMode::kStarting;
    attitude_.restart();
    is_turn_lost_ = false;
  }

  void start(Instant at) {
    const auto& state = coordinates_.state();
    coordinates_.start(at,
                       has_imu() ? std::optional(attitude_.q_WB(at, state.bias_w)) : std::nullopt);
    mode_ = FilterMode::kRunning;
  }

  /// @return false when the gyroscope is saturated: views compared by it are invalid
  bool add(const ImuSample& imu);

  /// The motion is unknown from now on.
  void lose_motion(bool is_turn_lost) {
    mode_ = FilterMode::kLost;
    coordinates_.lose_motion();
    attitude_.restart();
    is_turn_lost_ = is_turn_lost;
  }

  void jump(const Pose& X_AB, Instant at) {
    jump_search_.forget_all();
    instant_.clear();
    coordinates_.jump(X_AB, at);
    mode_ = FilterMode::kRunning;
    is_turn_lost_ = false;
  }

  /// Search for a jump of a camera's clock.
  [[nodiscard]] JumpSearch& jump_search() { return jump_search_; }

  /// Propagates the state to the image.
  /// @return false: not possible without IMU and usable tags
  bool move_to(const TagObservations& seen, std::span<const TagToUse> usable) {
    if (seen.exposed_at == coordinates_.state().time) return true;  // another camera, same instant
    if (!has_imu()) return !usable.empty() && move_by_corners(seen, usable);
    integrate_to(seen.exposed_at);
    coordinates_.finish_motion();
    return true;
  }

  /// Pose of the body by the tags of one image, with the gyroscope's rotation. Without IMU also by
  /// images of the same instant, with evidence scaled by the corner noise.
  [[nodiscard]] std::optional<PlaceFound> find_place(const TagObservations& seen,
                                                     std::span<const TagToUse> usable);

  /// While lost: the last pose, rotated by the gyroscope.
  [[nodiscard]] Pose turned(Instant at) const {
    Pose X_AB = coordinates_.X_AB();
    if (has_imu()) X_AB.q = X_AB.q * attitude_.q_LB(at, coordinates_.state().bias_w);
    return X_AB;
  }
  /// Position of the body by a single tag, relative to the estimate, W axes.
  [[nodiscard]] std::optional<Eigen::Vector3d> shift_by(const TagObservations& seen,
                                                        const TagToUse& tag) const;

  /// In fixed axes, for comparing views.
  [[nodiscard]] std::optional<CameraAttitude> camera_attitude(int camera, Instant at) const;

  [[nodiscard]] BodyEstimate estimate() const;

 private:
  void integrate_to(Instant to);

  /// Variance of an image's corners relative to the configured one; at least 1.
  [[nodiscard]] double excess(const PlaceFound& found, int camera) const {
    const double noise = coordinates_.noise(camera).unexplained_px() / config_.corner_noise_px;
    return std::max({1.0, noise * noise, found.misfit});
  }

  void step_to(Instant to, const InertialInput& input, double longest_s);
  bool move_by_corners(const TagObservations& seen, std::span<const TagToUse> usable);

  BodySensors sensors_;
  EstimatorConfig config_;
  Coordinates coordinates_;
  FilterMode mode_{FilterMode::kStarting};
  ImuBuffer imu_;
  AttitudeStart attitude_;
  JumpSearch jump_search_;
  bool is_turn_lost_{false};
  /// Known tags seen by all cameras at the last instant, for a lost body without IMU.
  std::vector<std::pair<TagObservation, SightedTag>> instant_;
  Instant instant_at_{};
};

}  // namespace fiducap
