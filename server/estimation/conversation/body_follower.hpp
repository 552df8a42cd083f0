#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/assert.hpp"
#include "base/so3.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/conversation/jump_search.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/filter/tag_measurement.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/start/attitude_start.hpp"
#include "estimation/start/clock_hypothesis.hpp"
#include "estimation/start/place_search.hpp"
#include "estimation/start/tag_candidates.hpp"

namespace fiducap {

enum class FilterMode {
  kStarting,  ///< No tags yet, no pose.
  kAdrift,    ///< Tags and workspace are known, the motion since then is not.
  kRunning,
};

/// Follows the motion of the body: over the IMU's readings, or, without one, along a white noise
/// acceleration and angular acceleration, linearised at the motion that each image's own tags show.
/// Says what is known of the attitude while there is no pose.
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
  /// While adrift: the gyro does not say how the body turned since.
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

  /// @return false when the reading was left out, or views made with the gyro are worth nothing now
  bool add(const ImuSample& imu);

  /// The motion is unknown from here on.
  void lose_motion(bool is_turn_lost) {
    mode_ = FilterMode::kAdrift;
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

  /// Whether a camera's clock has jumped, by where the body was.
  [[nodiscard]] JumpSearch& jump_search() { return jump_search_; }

  /// Moves the state to the image.
  /// @return false when it does not get there: without IMU and usable tags
  bool move_to(const TagObservations& seen, std::span<const TagToUse> usable);

  /// Where one image's tags together say the body is; the gyro still says how it turned. Without an
  /// IMU also those of the cameras that exposed at the same instant, and evidence counts as much as
  /// the corners' noise, learned or seen, lets it.
  [[nodiscard]] std::optional<PlaceFound> find_place(const TagObservations& seen,
                                                     std::span<const TagToUse> usable);

  /// While adrift: where the body is by the gyro alone, with the place of the last image.
  [[nodiscard]] Pose turned(Instant at) const;
  /// Where one tag alone says that the body is, from where it is thought to be, W axes.
  [[nodiscard]] std::optional<Eigen::Vector3d> shift_by(const TagObservations& seen,
                                                        const TagToUse& tag) const;

  /// In axes that stand still, for comparing views.
  [[nodiscard]] std::optional<CameraAttitude> camera_attitude(int camera, Instant at) const;

  [[nodiscard]] BodyEstimate estimate() const;

 private:
  void integrate_to(Instant to);

  [[nodiscard]] std::optional<PlaceFound> find_place_of_rig(std::vector<SightedTag> tags,
                                                            const PlaceGuess& guess,
                                                            const TagObservations& seen);

  /// By how much an image's corners are noisier than configured, squared; at least 1.
  [[nodiscard]] double excess(const PlaceFound& found, int camera) const;

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
  /// What the cameras that exposed last, together, saw of known tags: for a body without IMU that
  /// does not know where it is.
  std::vector<std::pair<TagObservation, SightedTag>> instant_;
  Instant instant_at_{};
};

}  // namespace fiducap
