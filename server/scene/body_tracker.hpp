#pragma once

#include <cstdint>
#include <optional>

#include "base/config_check.hpp"
#include "base/time.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/output_predictor.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// When a pose may be shown.
struct BodyLimits {
  double max_position_sigma_m{0.25};
  double max_rotation_sigma_rad{0.2};
  double coast_after_s{0.15};  ///< No used tag for this long: coasting.
  double lose_after_s{5.0};    ///< No used tag for this long: lost, whatever the sigma says.

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// The life of one body: searching → tracking → coasting → lost, and whether its pose may be shown.
/// Not thread-safe; Scene guards it.
class BodyTracker final {
 public:
  BodyTracker(int body_id, const Pose& X_BP, const BodyLimits& limits, const BodySensors& sensors,
              const EstimatorConfig& estimator);

  void add_imu(const ImuSample& imu);
  /// @param processing  arrival of the image → now
  void ingest(const std::optional<BodyEstimate>& estimate, const UpdateReport& report, Duration processing,
              std::uint64_t images_dropped);
  /// The source ended or failed.
  void source_lost();
  /// The body at one instant, pivot applied (lever arm included), state and validity decided.
  void sample(Instant at, BodyPose& out) const;
  /// True once after the body became lost: the filter must start again.
  [[nodiscard]] bool wants_reset(Instant now) const;

 private:
  [[nodiscard]] BodyState state_at(Instant at, const BodyPose& pose) const;

  int body_id_;
  Pose X_BP_;
  BodyLimits limits_;
  OutputPredictor predictor_;
  bool anchored_{false};
  bool source_lost_{false};
  std::optional<Instant> last_tag_at_;
  std::optional<Instant> last_image_at_;
  UpdateReport report_;
  Duration processing_{};
  double image_rate_hz_{0};
  std::uint64_t images_dropped_{0};
};

}  // namespace fiducap
