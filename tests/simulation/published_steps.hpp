#pragma once

#include "pipeline/body_tracker.hpp"
#include "pipeline/body_update.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// Largest steps of valid published poses from frame to frame beyond the true motion, in published
/// sigmas (those of the worst axis), and the sum of those sigmas.
struct StepFigures {
  double position{};
  double attitude{};
  double sigma_m{};  ///< Sum over the valid frames.
  int valid{};
  int frames{};

  /// Of several bodies.
  void add(const StepFigures& other);
};

/// A BodyTracker with the inputs of the live server, sampled at 100 Hz: IMU samples at once, images
/// after their processing time.
class PublishedSteps final {
 public:
  PublishedSteps(const EstimationData& data, const BodySensors& sensors,
                 const EstimatorConfig& estimator, const RampConfig& ramp);

  void take(const BodyUpdate& update);
  [[nodiscard]] const StepFigures& figures() const { return figures_; }

 private:
  void publish_until(Instant now);
  void compare(const BodyPose& pose, Instant at);

  const EstimationData& data_;
  BodyTracker tracker_;
  std::size_t next_sample_{0};
  Instant next_frame_;
  std::optional<Pose> X_WB_;  ///< Of the frame before, if it was valid.
  Pose X_RB_;                 ///< Its truth.
  StepFigures figures_;
};

}  // namespace fiducap
