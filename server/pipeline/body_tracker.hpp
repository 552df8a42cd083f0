#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/time.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/imu/output_predictor.hpp"
#include "pipeline/body_pose.hpp"
#include "pipeline/correction_ramp.hpp"

namespace fiducap {

/// When a pose may be published.
struct BodyLimits {
  double max_position_sigma_m{0.25};   ///< A pose with a larger sigma is invalid (worst axis).
  double max_rotation_sigma_rad{0.2};  ///< The same for the attitude.
  double coast_after_s{0.15};          ///< No used tag for this long: coasting.
  /// No used tag and no followed points for this long: lost, with any sigma.
  double lose_after_s{5.0};

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// State of one body (searching → tracking → coasting → lost) and validity of its pose.
///
/// Searching until a used tag ties the body to the workspace; tracking and coasting by the age of
/// the last used tag, coasting only after a valid pose; lost after `lose_after_s`, when its filter
/// has given up the motion, or when the source has ended, until a tag is used again. A pose is
/// valid while tracking or coasting with both sigmas inside the limits. An invalid pose is that of
/// the last used tag; it moves along when W is redefined.
///
/// Corrections of a valid pose by the map are published gradually (CorrectionRamp); the rest is
/// part of the sigma, so also of the limits. A correction beyond the limits is published at once,
/// and the pose is invalid for a moment, so that clients notice the jump (PoseJumps counts it). No
/// ramp for an invalid pose, or after a new generation, another start or a redefinition of W.
/// Images that show the map's tags bring its corrections as well: no image moves a body by a sigma
/// in one frame, unless there is no IMU to separate corrections from motion.
///
/// Not thread-safe; Scene guards it.
class BodyTracker final {
 public:
  BodyTracker(int body_id, const Pose& X_BP, const BodyLimits& limits, const BodySensors& sensors,
              const EstimatorConfig& estimator, const RampConfig& ramp = {});

  /// A reading straight from the device (see OutputPredictor).
  void add_imu(const ImuSample& imu);
  /// The filter's result for one image, with or without tags.
  /// @param estimate    nullopt: the filter does not run
  /// @param processing  arrival of the image → now
  void ingest(const std::optional<BodyEstimate>& estimate, const UpdateReport& report,
              Duration processing, std::uint64_t images_dropped);
  void set_pivot(const Pose& X_BP) { X_BP_ = X_BP; }
  /// The source ended or failed: lost until the next image.
  void source_lost();
  /// The body's pivot at one instant, with state and validity. Overwrites all of `out`.
  void sample(Instant at, BodyPose& out) const;

 private:
  [[nodiscard]] BodyState state_at(Instant at) const;
  [[nodiscard]] bool within_limits(const BodyPose& pose) const;
  [[nodiscard]] std::optional<Pose> shown_at(Instant at) const;
  [[nodiscard]] bool follows(const std::optional<BodyEstimate>& estimate,
                             const UpdateReport& report) const;
  [[nodiscard]] Instant newest(const UpdateReport& report, Duration processing) const;
  void note_tags(const BodyEstimate& estimate);
  void bridge(const Pose& shown, Instant from);
  [[nodiscard]] double image_rate_at(Instant at) const;
  void count_image(Instant exposed_at);

  int body_id_;
  Pose X_BP_;
  BodyLimits limits_;
  double rate_variance_;  ///< (rad/s)², gyro noise of one sample.
  OutputPredictor predictor_;
  bool estimated_{false};
  bool anchored_{false};
  bool source_lost_{false};
  bool has_been_valid_{false};
  std::optional<BodyEstimate> last_seen_;  ///< The anchored estimate of the last used tag.
  std::optional<Instant> last_tag_at_;
  std::optional<Instant> last_carried_at_;  ///< The same, or followed points instead.
  std::optional<Instant> last_image_at_;
  Instant last_imu_at_{};
  double longest_imu_gap_s_;  ///< Beyond, the motion is known by images only.
  CorrectionRamp ramp_;
  std::optional<Instant> hidden_until_;  ///< After a correction too large for a ramp.
  double image_interval_s_{0};           ///< Smoothed; 0: not known.
  UpdateReport report_;                  ///< Of the newest image.
  Duration processing_{};
  std::uint64_t images_dropped_{0};
};

}  // namespace fiducap
