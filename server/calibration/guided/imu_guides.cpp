#include "calibration/guided/guides.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fiducap {
namespace {

constexpr double kAveraged_s = 1;
// Far above the noise of any unit: a touch, a step on the floor. Smaller motion is detected at the
// end, over all samples.
constexpr double kTouched_rad_s = 0.1;
constexpr double kTouched_m_s2 = 1.0;
// Limits the memory for a unit of 8 kHz.
constexpr std::size_t kMostReadings = 600'000;

constexpr double kShaking_m_s2 = 1.5;
constexpr double kShakenEnough_s = 6;
constexpr double kSeenEnough_s = 25;  // of images with tags
constexpr double kLongestStep_s = 0.1;
constexpr double kForceFilter_s = 2;  // of the running mean of the force: gravity, mostly
constexpr double kGoodTime_s = 1e-3;
constexpr Duration kKeptRest = std::chrono::seconds(2);  // before the wave
// A few minutes.
constexpr std::size_t kMostSamples = 400'000;
constexpr std::size_t kMostFrames = 20'000;

/// Keeps up to a second more, to erase rarely. Images are compared by their own clock.
void drop_before(Instant instant, LoadedSamples& samples) {
  auto& imu = samples.imu;
  if (imu.empty() || imu.front().sampled_at > instant - std::chrono::seconds(1)) return;
  const Duration kept = imu.back().sampled_at - instant;
  imu.erase(imu.begin(), std::ranges::find_if(
                             imu, [&](const ImuSample& one) { return one.sampled_at >= instant; }));
  auto& frames = samples.frames;
  while (!frames.empty() && frames.front().exposed_at < frames.back().exposed_at - kept) {
    samples.tags -= static_cast<long>(frames.front().tags.size());
    frames.erase(frames.begin());
  }
}

double share_of(double seconds, double enough) { return std::min(1.0, seconds / enough); }

}  // namespace

void RestGuide::take(const ImuSample& sample) {
  if (!sample.w_WB_B.allFinite() || !sample.f_B.allFinite() || is_enough()) return;
  if (!samples_.empty() && sample.sampled_at <= samples_.back().sampled_at) return;
  const bool is_averaged = !samples_.empty() && share() * kLongEnough_s >= kAveraged_s;
  const bool has_moved =
      is_averaged && ((sample.w_WB_B - mean_w_).cwiseAbs().maxCoeff() > kTouched_rad_s ||
                      (sample.f_B - mean_f_).cwiseAbs().maxCoeff() > kTouched_m_s2);
  if (has_moved || samples_.size() >= kMostReadings) {
    begin();
    moved_ = true;
  }
  if (share() * kLongEnough_s < kAveraged_s) {
    ++averaged_;
    mean_w_ += (sample.w_WB_B - mean_w_) / averaged_;
    mean_f_ += (sample.f_B - mean_f_) / averaged_;
  }
  samples_.push_back(sample);
}

double RestGuide::share() const {
  if (samples_.empty()) return 0;
  const double seconds = to_seconds(samples_.back().sampled_at - samples_.front().sampled_at);
  return std::min(1.0, seconds / kLongEnough_s);
}

std::string RestGuide::hint() const {
  if (samples_.empty()) return "No sample from the IMU yet.";
  if (is_enough()) return "Enough.";
  const int left = static_cast<int>(std::ceil((1 - share()) * kLongEnough_s));
  return std::string(moved_ ? "It moved; restarted. " : "") +
         "Let it lie on a table, do not touch it: " + std::to_string(left) + " s more.";
}

Expected<StaticImuNoise> RestGuide::result() const {
  return identify_static_imu(samples_, "the IMU");
}

void RestGuide::begin() {
  samples_.clear();
  mean_w_.setZero();
  mean_f_.setZero();
  averaged_ = 0;
}

void WaveGuide::take(const ImuSample& sample) {
  if (!sample.w_WB_B.allFinite() || !sample.f_B.allFinite()) return;
  auto& imu = samples_.imu;
  if (!imu.empty() && sample.sampled_at <= imu.back().sampled_at) return;
  if (imu.size() >= kMostSamples) begin();
  stillness_.add(sample);
  const double step =
      imu.empty() ? 0
                  : std::min(kLongestStep_s, to_seconds(sample.sampled_at - imu.back().sampled_at));
  if (imu.empty()) mean_f_ = sample.f_B;
  mean_f_ += (sample.f_B - mean_f_) * std::min(1.0, step / kForceFilter_s);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double rate = std::abs(sample.w_WB_B(static_cast<Eigen::Index>(axis)));
    if (rate > kTurning) turned_s_[axis] += step;
  }
  if ((sample.f_B - mean_f_).norm() > kShaking_m_s2) shaken_s_ += step;
  imu.push_back(sample);
  if (!has_begun_) await_wave();
  advise();
}

/// Before the wave, keeps only the last seconds of the rest.
void WaveGuide::await_wave() {
  turned_s_ = {};
  shaken_s_ = seen_s_ = 0;
  if (stillness_.still_s() > 0) {
    drop_before(samples_.imu.back().sampled_at - kKeptRest, samples_);
    is_ready_ = stillness_.is_still() && samples_.tags > 0;
  } else if (is_ready_ && !stillness_.is_new()) {
    has_begun_ = samples_.begins_still = true;
  } else {
    const ImuSample newest = samples_.imu.back();
    samples_ = {};
    samples_.imu = {newest};
    is_ready_ = false;
  }
}

void WaveGuide::take(CornerFrame corners) {
  auto& frames = samples_.frames;
  if (!frames.empty() && corners.exposed_at <= frames.back().exposed_at) return;
  if (frames.size() >= kMostFrames) begin();
  if (!frames.empty() && !corners.tags.empty())
    seen_s_ += std::min(kLongestStep_s, to_seconds(corners.exposed_at - frames.back().exposed_at));
  samples_.tags += static_cast<long>(corners.tags.size());
  frames.push_back(std::move(corners));
  advise();
}

void WaveGuide::advise() {
  for (std::size_t axis = 0; axis < 3; ++axis)
    progress_.turned[axis] = share_of(turned_s_[axis], kTurnedEnough_s);
  progress_.shaken = share_of(shaken_s_, kShakenEnough_s);
  progress_.seen = share_of(seen_s_, kSeenEnough_s);
  const bool all_turned = *std::ranges::min_element(progress_.turned) >= 1;
  progress_.is_enough = has_begun_ && all_turned && progress_.shaken >= 1 && progress_.seen >= 1;
  progress_.hint = hint();
}

std::string WaveGuide::hint() const {
  static const std::array<const char*, 3> kMotions{
      "roll it about its forward axis", "pitch it up and down", "turn it left and right"};
  if (progress_.is_enough) return "Enough: solving.";
  if (samples_.imu.empty()) return "No sample from the IMU yet.";
  if (!has_begun_ && stillness_.is_still() && samples_.tags == 0) return "Show tags to the camera.";
  if (!has_begun_ && !is_ready_) return "Hold it still for two seconds, with tags in view.";
  const auto& turned = progress_.turned;
  const auto least = std::ranges::min_element(turned);
  if (*least < 1)
    return std::string("Quickly back and forth, with the tags in view: ") +
           kMotions.at(static_cast<std::size_t>(least - turned.begin())) + ".";
  if (progress_.shaken < 1) return "Shake it: quickly forward and back, to the sides, up and down.";
  return "Continue, with the tags in view.";
}

void WaveGuide::begin() { *this = WaveGuide(); }

std::vector<std::string> weaknesses_of(const CameraImuCalibration& calibration) {
  std::vector<std::string> all;
  for (std::size_t k = 0; k < calibration.verdicts.size(); ++k) {
    for (std::size_t axis = 0; axis < 6; ++axis) {
      if (calibration.verdicts[k].axes[axis].observed) continue;
      all.push_back("The camera's pose is not fully observed: " + motion_for_axis(axis) + ".");
    }
  }
  if (calibration.begins_in_motion)
    all.emplace_back(
        "No rest with tags in view was found; the result may be centimetres off: hold it still for "
        "two seconds, then wave.");
  if (calibration.time.at_border)
    all.emplace_back("The clock offset of camera and IMU is larger than the searched range.");
  else if (!calibration.time.determined || calibration.time.sigma_s > kGoodTime_s)
    all.emplace_back(
        "The camera's clock is not known to a millisecond: rotate quickly back and forth.");
  return all;
}

}  // namespace fiducap
