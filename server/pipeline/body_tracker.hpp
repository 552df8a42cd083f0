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

/// When a pose may be shown.
struct BodyLimits {
  double max_position_sigma_m{0.25};
  double max_rotation_sigma_rad{0.2};
  double coast_after_s{0.15};  ///< No used tag for this long: coasting.
  /// No used tag, nor followed points in its stead, for this long: lost, whatever the sigma says.
  double lose_after_s{5.0};

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// The life of one body: searching → tracking → coasting → lost, and whether its pose may be shown.
///
/// searching until a used tag ties the body to the workspace; tracking and coasting by the age of
/// the last used tag; lost from `lose_after_s` on, when its filter gave the motion up, or when the
/// source ended, until a tag is used again. A pose is valid while tracking or coasting with both
/// sigmas inside the limits. An invalid pose is history: what the last used tag said; it moves
/// along when W is re-defined.
///
/// What the map corrects about a body that is shown is published little by little (CorrectionRamp),
/// and what is left of it is in the sigma, so also in the limits. A correction that does not fit
/// into them is no ramp: the pose is right at once, and not valid for a moment, so that clients see
/// that it comes back, elsewhere (PoseJumps counts that). A pose that is not valid needs no ramp,
/// nor does one that relates to nothing before: a new generation, another start, W re-defined. What
/// the map has learned comes with images as well, when they show its tags: so no image moves a body
/// by a sigma in one frame, either, unless there is no IMU to tell corrections from motion.
///
/// Not thread-safe; Scene guards it.
class BodyTracker final {
 public:
  BodyTracker(int body_id, const Pose& X_BP, const BodyLimits& limits, const BodySensors& sensors,
              const EstimatorConfig& estimator, const RampConfig& ramp = {});

  /// A reading straight from the device (see OutputPredictor).
  void add_imu(const ImuSample& imu);
  /// What the filter said to one image, also when no tag was in it.
  /// @param estimate    nullopt: the filter does not run
  /// @param processing  arrival of the image → now
  void ingest(const std::optional<BodyEstimate>& estimate, const UpdateReport& report,
              Duration processing, std::uint64_t images_dropped);
  void set_pivot(const Pose& X_BP) { X_BP_ = X_BP; }
  /// The source ended or failed: lost until the next image.
  void source_lost();
  /// The body at one instant, pivot applied (lever arm included), state and validity decided.
  /// Overwrites all of `out`.
  void sample(Instant at, BodyPose& out) const;

 private:
  [[nodiscard]] BodyState state_at(Instant at) const;
  [[nodiscard]] bool unseen_for(Instant at, double seconds) const;
  [[nodiscard]] bool lost_by(Instant at) const;
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
  std::optional<BodyEstimate> last_seen_;  ///< The anchored estimate of the last used tag.
  std::optional<Instant> last_tag_at_;
  std::optional<Instant> last_carried_at_;  ///< The same, or followed points in its stead.
  std::optional<Instant> last_image_at_;
  Instant last_imu_at_{};
  double longest_imu_gap_s_;  ///< Beyond, images alone say how the body moves.
  CorrectionRamp ramp_;
  std::optional<Instant> hidden_until_;  ///< The map moved it too far for a ramp.
  double image_interval_s_{0};           ///< Smoothed; 0: not known.
  UpdateReport report_;                  ///< Of the newest image.
  Duration processing_{};
  std::uint64_t images_dropped_{0};
};

}  // namespace fiducap
