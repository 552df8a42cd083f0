#include "pipeline/body_tracker.hpp"

#include <algorithm>

#include "estimation/filter/filter_rules.hpp"

namespace fiducap {
namespace {

// About ten images: fast enough to show a slowing camera, slow enough to be readable.
constexpr double kIntervalSmoothing = 0.1;
// A longer pause is an interruption, not a rate.
constexpr double kLongestInterval_s = 1.0;
// Images that are this many intervals overdue lower the displayed rate.
constexpr double kOverdueIntervals = 3.0;
// Long enough for clients of 10 Hz.
constexpr Duration kHidden = std::chrono::milliseconds(200);
// Readings stamped later than this after an image are ignored here.
constexpr Duration kLongestLead = std::chrono::seconds(1);

/// The same estimate in other axes. @param X_new_old  old W in new W
BodyEstimate moved(BodyEstimate estimate, const Pose& X_new_old) {
  const Eigen::Matrix3d R = X_new_old.rotation();
  estimate.X_WB = X_new_old * estimate.X_WB;
  estimate.v_WB = R * estimate.v_WB;
  estimate.a_WB = R * estimate.a_WB;
  Matrix15d turn = Matrix15d::Identity();
  for (const int block :
       {estimate_block::kPosition, estimate_block::kAttitude, estimate_block::kVelocity})
    turn.block<3, 3>(block, block) = R;
  estimate.covariance = turn * estimate.covariance * turn.transpose();
  return estimate;
}

double rate_variance_of(const BodySensors& sensors) {
  if (!sensors.imu) return 0.0;
  return sensors.imu->gyro_noise_rad_s_rtHz * sensors.imu->gyro_noise_rad_s_rtHz *
         sensors.imu->rate_hz;
}

}  // namespace

std::vector<ConfigError> BodyLimits::check(const std::string& prefix) const {
  return Checker{prefix}
      .positive("max_position_sigma_m", max_position_sigma_m)
      .positive("max_rotation_sigma_rad", max_rotation_sigma_rad)
      .positive("coast_after_s", coast_after_s)
      .positive("lose_after_s", lose_after_s)
      .require(lose_after_s > coast_after_s, "lose_after_s", lose_after_s,
               "must be longer than coast_after_s")
      .errors;
}

BodyTracker::BodyTracker(int body_id, const Pose& X_BP, const BodyLimits& limits,
                         const BodySensors& sensors, const EstimatorConfig& estimator,
                         const RampConfig& ramp)
    : body_id_(body_id),
      X_BP_(X_BP),
      limits_(limits),
      rate_variance_(rate_variance_of(sensors)),
      predictor_(sensors, estimator),
      longest_imu_gap_s_(estimator.max_imu_gap_s),
      ramp_(ramp) {}

void BodyTracker::add_imu(const ImuSample& imu) {
  predictor_.add_imu(imu);
  last_imu_at_ = imu.sampled_at;
}

void BodyTracker::ingest(const std::optional<BodyEstimate>& estimate, const UpdateReport& report,
                         Duration processing, std::uint64_t images_dropped) {
  const Instant from = newest(report, processing);
  const bool is_bridged = follows(estimate, report) && ramp_.is_on();
  const auto shown = is_bridged ? shown_at(from) : std::nullopt;
  if (!shown) ramp_.forget();
  source_lost_ = false;
  if (last_seen_ && report.generation == report_.generation) {
    if (report.gauge_shift) last_seen_ = moved(*last_seen_, *report.gauge_shift);
    if (report.map_shift) last_seen_ = moved(*last_seen_, *report.map_shift);
  }
  report_ = report;
  processing_ = processing;
  images_dropped_ = images_dropped;
  count_image(report.exposed_at);
  estimated_ = estimate.has_value();
  anchored_ = estimate && estimate->anchored;
  if (!estimate) {
    predictor_.clear();
    return;
  }
  predictor_.set_estimate(*estimate);
  note_tags(*estimate);
  if (shown) bridge(*shown, from);
}

void BodyTracker::note_tags(const BodyEstimate& estimate) {
  if (report_.landmarks_used >= filter_rules::kLandmarksToStay && last_tag_at_)
    last_carried_at_ = report_.exposed_at;
  // A tag that has just entered the state ties the body as well as one that corrected it.
  if (report_.tags_used + report_.tags_added == 0) return;
  last_tag_at_ = report_.exposed_at;
  last_carried_at_ = report_.exposed_at;
  if (!anchored_) return;
  last_seen_ = estimate;
  has_been_valid_ = has_been_valid_ || shown_at(report_.exposed_at);
}

/// The new poses continue those before, moved by the map at most.
bool BodyTracker::follows(const std::optional<BodyEstimate>& estimate,
                          const UpdateReport& report) const {
  return estimate && estimate->anchored && report.generation == report_.generation &&
         !report.gauge_shift && !report.relocalised && !report.start_changed;
}

/// No published frame is of a later instant, except without an IMU and with a large image delay.
Instant BodyTracker::newest(const UpdateReport& report, Duration processing) const {
  return std::clamp(last_imu_at_, report.exposed_at + std::min(processing, kLongestLead),
                    report.exposed_at + kLongestLead);
}

/// From the published pose to the filter's.
void BodyTracker::bridge(const Pose& shown, Instant from) {
  const BodyEstimate now = *predictor_.predict(from);
  if (report_.map_shift) {
    ramp_.correct(shown, now, from);
  } else if (to_seconds(report_.exposed_at - last_imu_at_) < longest_imu_gap_s_) {
    ramp_.follow(shown, now, from);
  } else {  // by images only: what they change is motion
    BodyEstimate expected = now;
    ramp_.apply(from, expected);
    ramp_.follow(expected.X_WB, now, from);
  }
  if (ramp_.is_over(from) || shown_at(from)) return;
  ramp_.forget();
  hidden_until_ = from + kHidden;
}

void BodyTracker::source_lost() {
  source_lost_ = true;
  ramp_.forget();
}

void BodyTracker::count_image(Instant exposed_at) {
  const double interval = last_image_at_ ? to_seconds(exposed_at - *last_image_at_) : 0.0;
  if (last_image_at_ && interval <= 0)
    return;  // two cameras at the same instant are one image for the rate
  last_image_at_ = exposed_at;
  if (interval > kLongestInterval_s) {
    image_interval_s_ = 0;
  } else if (interval > 0) {
    image_interval_s_ +=
        (image_interval_s_ > 0 ? kIntervalSmoothing : 1.0) * (interval - image_interval_s_);
  }
}

double BodyTracker::image_rate_at(Instant at) const {
  if (image_interval_s_ <= 0) return 0.0;
  const double since = to_seconds(at - *last_image_at_);
  return 1.0 / (since > kOverdueIntervals * image_interval_s_ ? since : image_interval_s_);
}

BodyState BodyTracker::state_at(Instant at) const {
  if (source_lost_) return BodyState::kLost;
  if (!last_tag_at_) return BodyState::kSearching;
  if (to_seconds(at - *last_carried_at_) > limits_.lose_after_s) return BodyState::kLost;
  if (!anchored_) return last_seen_ && !estimated_ ? BodyState::kLost : BodyState::kSearching;
  const bool is_unseen = to_seconds(at - *last_tag_at_) > limits_.coast_after_s;
  if (!is_unseen) return BodyState::kTracking;
  return has_been_valid_ ? BodyState::kCoasting : BodyState::kSearching;
}

bool BodyTracker::within_limits(const BodyPose& pose) const {
  const auto variances = pose.covariance.diagonal().array();
  return pose.X_WP.p.allFinite() && pose.X_WP.q.coeffs().allFinite() && pose.v_WP.allFinite() &&
         pose.w_WP_P.allFinite() && variances.isFinite().all() && (variances >= 0).all() &&
         pose.position_sigma_m() <= limits_.max_position_sigma_m &&
         pose.rotation_sigma_rad() <= limits_.max_rotation_sigma_rad;
}

/// X_WB as published; nullopt: invalid.
std::optional<Pose> BodyTracker::shown_at(Instant at) const {
  BodyPose pose;
  sample(at, pose);
  return pose.valid ? std::optional(pose.X_WP * X_BP_.inverse()) : std::nullopt;
}

void BodyTracker::sample(Instant at, BodyPose& out) const {
  out = BodyPose{};
  out.body_id = body_id_;
  out.state = state_at(at);
  const bool alive = out.state == BodyState::kTracking || out.state == BodyState::kCoasting;
  if (auto shown = alive ? predictor_.predict(at) : last_seen_) {
    if (alive) ramp_.apply(at, *shown);
    write_pivot(*shown, X_BP_, rate_variance_, out);
  }
  out.valid = alive && within_limits(out) && !(hidden_until_ && at < *hidden_until_);
  if (last_tag_at_) out.age = at - *last_tag_at_;
  if (out.state == BodyState::kTracking) {
    out.tags_in_view = report_.tags_used;
    out.reprojection_px = report_.reprojection_px;
  }
  out.exposed_at = report_.exposed_at;
  out.image_rate_hz = image_rate_at(at);
  out.processing = processing_;
  out.images_dropped = images_dropped_;
}

}  // namespace fiducap
