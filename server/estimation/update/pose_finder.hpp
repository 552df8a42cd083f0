#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "estimation/start/place_search.hpp"
#include "estimation/start/tag_candidates.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap {

/// Finds the pose of a starting or lost body: rotation by the gyroscope since the motion was lost,
/// and the pose by the tags of one image.
class PoseFinder final {
 public:
  PoseFinder(const EstimatorConfig& config, bool has_imu) : config_(config), has_imu_(has_imu) {}

  /// The next sample of the gyroscope.
  void add(const ImuSample& imu, const world::FilterState& state) {
    attitude_.add(imu, state.bias_w, state.bias_f);
  }
  /// @param is_turn_lost  the rotation since the last pose is not known by the gyroscope
  void restart(bool is_turn_lost) {
    attitude_.restart();
    is_turn_lost_ = is_turn_lost;
  }
  void forget_instant() { instant_.clear(); }
  void note_found() {
    forget_instant();
    is_turn_lost_ = false;
  }
  [[nodiscard]] bool is_turn_lost() const { return is_turn_lost_; }
  [[nodiscard]] bool knows_attitude() const { return !has_imu_ || attitude_.ready(); }
  /// nullopt: without IMU.
  [[nodiscard]] std::optional<Eigen::Quaterniond> level_attitude(const world::FilterState& state,
                                                                 Instant at) const;
  /// While lost: the last pose, rotated by the gyroscope.
  [[nodiscard]] Pose turned(const world::FilterState& state, Instant at) const;
  /// In fixed axes, for comparing views. @param turn_sigma_rad  of a body that is tracked without
  /// IMU; nullopt: it is not tracked
  [[nodiscard]] std::optional<CameraAttitude> camera_attitude(
      const world::FilterState& state, int camera, Instant at,
      std::optional<double> turn_sigma_rad) const;

  /// Pose of the body by the tags of one image, with the gyroscope's rotation. Without IMU also by
  /// images of the same instant, with evidence scaled by the corner noise.
  /// @param corner_px  learned noise of the corners
  [[nodiscard]] std::optional<PlaceFound> find(const world::FilterState& state, Instant at,
                                               std::vector<SightedTag> tags, double corner_px);
  /// Variance of an image's corners relative to the configured one; at least 1.
  [[nodiscard]] double excess(const PlaceFound& found, double corner_px) const;
  /// Position of the body by a single tag, relative to the estimate, W axes.
  [[nodiscard]] std::optional<Eigen::Vector3d> shift_by(const world::FilterState& state,
                                                        const SightedTag& tag) const;

 private:
  const EstimatorConfig& config_;
  bool has_imu_;
  AttitudeStart attitude_;
  bool is_turn_lost_{false};
  /// Known tags seen by all cameras at the last instant, for a lost body without IMU.
  std::vector<std::pair<TagObservation, SightedTag>> instant_;
  Instant instant_at_{};
};

}  // namespace fiducap
