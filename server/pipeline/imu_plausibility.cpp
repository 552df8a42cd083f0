#include "pipeline/imu_plausibility.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/so3.hpp"
#include "detection/tag_pose.hpp"

namespace fiducap {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
// 400 forces then take four seconds at least: longer than a jump or a shake.
constexpr Duration kForceStep = std::chrono::milliseconds(10);
// Between two looks: long enough for a turn, short enough for a gyro with a bias.
constexpr Duration kShortestTurn = std::chrono::milliseconds(240);
constexpr Duration kLongestTurn = std::chrono::milliseconds(1000);
// The gyro is not known over a pause.
constexpr Duration kLongestStep = std::chrono::milliseconds(100);
// One tag's attitude is good to a degree or two.
constexpr double kSmallestTurn_rad = 3 * kDegree;
constexpr double kTolerance_rad = 1.5 * kDegree;
constexpr double kTolerance = 0.25;
constexpr int kVotes = 8;
constexpr int kMostComparisons = 400;
// After it the device may have been opened again, or be another one.
constexpr Duration kPause = std::chrono::seconds(1);
// So many sound judgements in a row end a fault of the forces: 12 s.
constexpr int kSoundForces = 3;

bool explains(double turned_rad, double seen_rad) {
  return std::abs(turned_rad - seen_rad) < kTolerance_rad + kTolerance * seen_rad;
}

std::optional<ImuFault> fault_of_force(double median_m_s2) {
  if (median_m_s2 < 0.4) return ImuFault::kForceWithoutGravity;
  if (median_m_s2 > 0.7 && median_m_s2 < 1.5) return ImuFault::kForceInG;
  if (median_m_s2 > 700 && median_m_s2 < 1500) return ImuFault::kForceInMilliG;
  if (median_m_s2 < 6.5 || median_m_s2 > 16) return ImuFault::kForceUnlikely;
  return std::nullopt;
}

}  // namespace

std::string_view text_of(ImuFault fault) {
  switch (fault) {
    case ImuFault::kForceInG:
      return "the accelerometer seems to give g: its median is about 1, expected are m/s² (9.81 at "
             "rest). Multiply its readings by 9.80665";
    case ImuFault::kForceInMilliG:
      return "the accelerometer seems to give thousandths of g: its median is about 1000, expected "
             "are m/s² (9.81 at rest). Multiply its readings by 0.00980665";
    case ImuFault::kForceWithoutGravity:
      return "the accelerometer shows no gravity: its median is about 0, expected is 9.81 m/s² at "
             "rest. Take its raw readings, not the linear acceleration of an attitude filter, or "
             "look at the sensor";
    case ImuFault::kForceUnlikely:
      return "the accelerometer's median is far from gravity (9.81 m/s²). Look at its unit, its "
             "range and its scale";
    case ImuFault::kRateInDegreesPerSecond:
      return "the gyro seems to give degrees per second: its turns are 57 times those that the "
             "tags show; expected are rad/s. Multiply its readings by 0.0174533";
    case ImuFault::kFlow:
      return "the IMU's readings do not come as they should";
  }
  return {};
}

bool is_fatal(ImuFault fault) {
  return fault != ImuFault::kForceUnlikely && fault != ImuFault::kFlow;
}

void ImuPlausibility::add(const ImuSample& imu) {
  if (last_at_ && imu.sampled_at - *last_at_ > kPause) judge_anew();
  last_at_ = imu.sampled_at;
  flow_.add(imu);
  if (flow_.fault() != flow_fault_) judge_flow();
  if (forces_ < kForces && (!last_force_at_ || imu.sampled_at - *last_force_at_ >= kForceStep)) {
    last_force_at_ = imu.sampled_at;
    forces_m_s2_[forces_++] = imu.f_B.norm();
    if (forces_ == kForces) judge_forces();
  }
  if (rates_are_judged()) return;
  const std::optional<ImuSample> before = std::exchange(last_, imu);
  if (!before) return;
  const Duration step = imu.sampled_at - before->sampled_at;
  if (step > kLongestStep || step <= Duration{0}) return look_.reset();
  const Eigen::Vector3d turn = 0.5 * to_seconds(step) * (before->w_WB_B + imu.w_WB_B);
  turned_ = (turned_ * exp_so3(turn)).normalized();
  turned_by_degrees_ = (turned_by_degrees_ * exp_so3(kDegree * turn)).normalized();
}

/// What was found stands until the opposite is found.
void ImuPlausibility::judge_anew() {
  forces_ = 0;
  sound_forces_ = 0;
  last_force_at_.reset();
  last_.reset();
  look_.reset();
  comparisons_ = for_radians_ = for_degrees_ = 0;
}

void ImuPlausibility::judge_forces() {
  const auto middle = forces_m_s2_.begin() + kForces / 2;
  std::nth_element(forces_m_s2_.begin(), middle, forces_m_s2_.end());
  const std::optional<ImuFault> found = fault_of_force(*middle);
  sound_forces_ = found ? 0 : sound_forces_ + 1;
  if (found && found != force_fault_) force_fault_ = force_news_ = found;
  if (!force_fault_) return;
  forces_ = 0;  // looked at until it is mended
  if (sound_forces_ < kSoundForces) return;
  force_fault_.reset();
  say_what_is_left();
}

void ImuPlausibility::judge_rates() {
  const bool degrees = for_degrees_ >= kVotes;
  if (degrees && !rate_fault_) rate_fault_ = rate_news_ = ImuFault::kRateInDegreesPerSecond;
  if (!rate_fault_) return;
  if (for_radians_ >= kVotes) {
    rate_fault_.reset();
    say_what_is_left();
  } else {
    comparisons_ = for_radians_ = for_degrees_ = 0;  // looked at until it is mended
  }
}

void ImuPlausibility::judge_flow() {
  flow_fault_ = flow_.fault();
  flow_news_ = flow_fault_.has_value();
  if (!flow_fault_) say_what_is_left();
}

void ImuPlausibility::say_what_is_left() {
  force_news_ = force_fault_;
  rate_news_ = rate_fault_;
  flow_news_ = flow_fault_.has_value();
  all_clear_ = !force_fault_ && !rate_fault_ && !flow_fault_;
}

bool ImuPlausibility::rates_are_judged() const {
  return for_radians_ >= kVotes || for_degrees_ >= kVotes || comparisons_ >= kMostComparisons;
}

void ImuPlausibility::add(const TagObservations& seen, const CameraModel& camera) {
  if (rates_are_judged() || !last_ || seen.tags.empty()) return;
  if (look_ && seen.exposed_at - look_->at < kShortestTurn) return;
  if (look_ && seen.exposed_at - look_->at > kLongestTurn) look_.reset();
  if (look_ && look_->camera != seen.camera) return;
  const auto same = std::find_if(
      seen.tags.begin(), seen.tags.end(),
      [&](const TagObservation& tag) { return look_ && tag.tag_id == look_->tag.tag_id; });
  const bool again = same != seen.tags.end();
  const Look now{seen.camera, seen.exposed_at, again ? *same : seen.tags.front(), turned_,
                 turned_by_degrees_};
  if (again) compare(*look_, now, camera);
  look_ = now;
  if (rates_are_judged()) judge_rates();
}

void ImuPlausibility::compare(const Look& before, const Look& now, const CameraModel& camera) {
  const double turned_rad = angle_between(before.turned, now.turned);
  if (turned_rad < kSmallestTurn_rad) return;  // then it explains nothing in degrees either
  ++comparisons_;
  const Eigen::Quaterniond q_TV_before = solve_tag_pose(before.tag, camera)[0].X_VT.q.conjugate();
  const Eigen::Quaterniond q_TV_now = solve_tag_pose(now.tag, camera)[0].X_VT.q.conjugate();
  const double seen_rad = angle_between(q_TV_before, q_TV_now);
  if (seen_rad < kSmallestTurn_rad) return;
  const double by_degrees_rad = angle_between(before.turned_by_degrees, now.turned_by_degrees);
  const bool radians = explains(turned_rad, seen_rad);
  const bool degrees = explains(by_degrees_rad, seen_rad);
  if (radians != degrees) ++(radians ? for_radians_ : for_degrees_);
}

std::optional<ImuFault> ImuPlausibility::take_news() {
  if (force_news_) return std::exchange(force_news_, std::nullopt);
  if (rate_news_) return std::exchange(rate_news_, std::nullopt);
  return std::exchange(flow_news_, false) ? std::optional(ImuFault::kFlow) : std::nullopt;
}

std::string ImuPlausibility::text(ImuFault fault) const {
  return fault == ImuFault::kFlow ? flow_.text() : std::string(text_of(fault));
}

}  // namespace fiducap
