#include "calibration/guided/wave_guide.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/text.hpp"

namespace fiducap {
namespace {

constexpr double kShaking_m_s2 = 1.5;
constexpr double kShakenEnough_s = 6;
constexpr double kSeenEnough_s = 25;  // of images with tags
constexpr double kLongestStep_s = 0.1;
constexpr double kSlow_s = 2;  // of the running mean of the force: gravity, mostly
constexpr double kGoodTime_s = 1e-3;
constexpr Duration kCalm = std::chrono::seconds(2);  // of what comes before the wave
// A few minutes; what is older teaches nothing more.
constexpr std::size_t kMostSamples = 400'000;
constexpr std::size_t kMostFrames = 20'000;

/// A second of readings more stays than asked for, so that little is moved. Images by their own
/// clock.
void drop_before(Instant instant, LoadedSamples& samples) {
  auto& imu = samples.imu;
  if (imu.empty() || imu.front().sampled_at > instant - std::chrono::seconds(1)) return;
  const Duration kept = imu.back().sampled_at - instant;
  imu.erase(imu.begin(), std::find_if(imu.begin(), imu.end(), [&](const ImuSample& one) {
              return one.sampled_at >= instant;
            }));
  auto& frames = samples.frames;
  while (!frames.empty() && frames.front().exposed_at < frames.back().exposed_at - kept) {
    samples.tags -= static_cast<long>(frames.front().tags.size());
    frames.erase(frames.begin());
  }
}

double share(double seconds, double enough) { return std::min(1.0, seconds / enough); }

}  // namespace

void WaveGuide::take(const ImuSample& sample) {
  if (!sample.w_WB_B.allFinite() || !sample.f_B.allFinite()) return;
  auto& imu = samples_.imu;
  if (!imu.empty() && sample.sampled_at <= imu.back().sampled_at) return;
  if (imu.size() >= kMostSamples) begin();
  calm_.add(sample);
  const double step =
      imu.empty() ? 0
                  : std::min(kLongestStep_s, to_seconds(sample.sampled_at - imu.back().sampled_at));
  if (imu.empty()) mean_f_ = sample.f_B;
  mean_f_ += (sample.f_B - mean_f_) * std::min(1.0, step / kSlow_s);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double rate = std::abs(sample.w_WB_B(static_cast<Eigen::Index>(axis)));
    if (rate > kTurning) turned_s_[axis] += step;
  }
  if ((sample.f_B - mean_f_).norm() > kShaking_m_s2) shaken_s_ += step;
  imu.push_back(sample);
  if (!has_begun_) await_wave();
  advise();
}

/// Until it is waved only the last of its calm is kept, however long it stands there.
void WaveGuide::await_wave() {
  turned_s_ = {};
  shaken_s_ = seen_s_ = 0;
  if (calm_.calm_s() > 0) {
    drop_before(samples_.imu.back().sampled_at - kCalm, samples_);
    is_ready_ = calm_.is_calm() && samples_.tags > 0;
  } else if (is_ready_ && !calm_.is_new()) {
    has_begun_ = samples_.begins_calm = true;
  } else {
    const ImuSample newest = samples_.imu.back();
    samples_ = {{newest}, {}, 0};
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
    progress_.turned[axis] = share(turned_s_[axis], kTurnedEnough_s);
  progress_.shaken = share(shaken_s_, kShakenEnough_s);
  progress_.seen = share(seen_s_, kSeenEnough_s);
  const bool all_turned = *std::min_element(progress_.turned.begin(), progress_.turned.end()) >= 1;
  progress_.is_enough = has_begun_ && all_turned && progress_.shaken >= 1 && progress_.seen >= 1;
  progress_.hint = hint();
}

std::string WaveGuide::hint() const {
  static const std::array<const char*, 3> kMotions{
      "roll it about its forward axis", "pitch it up and down", "turn it left and right"};
  if (progress_.is_enough) return "Enough: it is solved for.";
  if (samples_.imu.empty()) return "Nothing has come from the IMU yet.";
  if (!has_begun_ && calm_.is_calm() && samples_.tags == 0) return "Show tags to the camera.";
  if (!has_begun_ && !is_ready_) return "Hold it still for two seconds, with tags in view.";
  const auto& turned = progress_.turned;
  const auto least = std::min_element(turned.begin(), turned.end());
  if (*least < 1)
    return std::string("Quickly to and fro, with the tags in view: ") +
           kMotions.at(static_cast<std::size_t>(least - turned.begin())) + ".";
  if (progress_.shaken < 1) return "Shake it: quickly forward and back, to the sides, up and down.";
  return "Go on, with the tags in view.";
}

void WaveGuide::begin() { *this = WaveGuide(); }

std::vector<std::string> weaknesses_of(const CameraImuCalibration& calibration) {
  std::vector<std::string> all;
  for (std::size_t k = 0; k < calibration.verdicts.size(); ++k) {
    for (std::size_t axis = 0; axis < 6; ++axis) {
      if (calibration.verdicts[k].axes[axis].observed) continue;
      all.push_back("Not all of where the camera sits was seen: " + motion_that_shows(axis) + ".");
    }
  }
  if (calibration.begins_in_motion)
    all.emplace_back(
        "No moment was found in which it was held still with tags in view, and it may be "
        "centimetres off: hold it still for two seconds, then wave.");
  if (calibration.time.at_border)
    all.emplace_back("The stamps of camera and IMU are further apart than was searched.");
  else if (!calibration.time.determined || calibration.time.sigma_s > kGoodTime_s)
    all.emplace_back("The camera's clock is not known to a millisecond: turn quickly to and fro.");
  return all;
}

}  // namespace fiducap
