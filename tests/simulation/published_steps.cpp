#include "simulation/published_steps.hpp"

#include <algorithm>

#include "base/pose.hpp"

namespace fiducap {

namespace {

constexpr Duration kFrame = std::chrono::milliseconds(10);
constexpr Duration kProcessing = std::chrono::milliseconds(20);  // exposure → update done

}  // namespace

void StepFigures::add(const StepFigures& other) {
  position = std::max(position, other.position);
  attitude = std::max(attitude, other.attitude);
  sigma_m += other.sigma_m;
  valid += other.valid;
  frames += other.frames;
}

PublishedSteps::PublishedSteps(const EstimationData& data, const BodySensors& sensors,
                               const EstimatorConfig& estimator, const RampConfig& ramp)
    : data_(data),
      tracker_(1, Pose{}, BodyLimits{}, sensors, estimator, ramp),
      next_frame_(time_of(data.samples.front())) {}

void PublishedSteps::take(const BodyUpdate& update) {
  publish_until(update.seen.exposed_at + kProcessing);
  tracker_.ingest(update.shown(), update.report, kProcessing, 0);
}

void PublishedSteps::publish_until(Instant now) {
  for (; next_frame_ < now; next_frame_ += kFrame) {
    for (;
         next_sample_ < data_.samples.size() && time_of(data_.samples[next_sample_]) <= next_frame_;
         ++next_sample_) {
      if (const auto* imu = std::get_if<ImuSample>(&data_.samples[next_sample_]))
        tracker_.add_imu(*imu);
    }
    BodyPose pose;
    tracker_.sample(next_frame_, pose);
    compare(pose, next_frame_);
  }
}

/// In body axes, independent of W.
void PublishedSteps::compare(const BodyPose& pose, Instant at) {
  const Pose X_RB = data_.truth_near(at).X_WB;
  if (pose.valid && X_WB_) {
    const Pose step = X_WB_->inverse() * pose.X_WP;
    const Pose motion = X_RB_.inverse() * X_RB;
    const double moved = (step.p - motion.p).norm() / pose.position_sigma_m();
    const double turned = angle_between(step.q, motion.q) / pose.rotation_sigma_rad();
    figures_.position = std::max(figures_.position, moved);
    figures_.attitude = std::max(figures_.attitude, turned);
  }
  if (pose.valid) {
    figures_.sigma_m += pose.position_sigma_m();
    ++figures_.valid;
  }
  ++figures_.frames;
  X_WB_ = pose.valid ? std::optional(pose.X_WP) : std::nullopt;
  X_RB_ = X_RB;
}

}  // namespace fiducap
