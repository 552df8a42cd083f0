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
// A few minutes; what is older teaches nothing more.
constexpr std::size_t kMostSamples = 400'000;
constexpr std::size_t kMostFrames = 20'000;

double share(double seconds, double enough) { return std::min(1.0, seconds / enough); }

}  // namespace

void WaveGuide::take(const ImuSample& sample) {
  if (!sample.w_WB_B.allFinite() || !sample.f_B.allFinite()) return;
  auto& imu = samples_.imu;
  if (!imu.empty() && sample.sampled_at <= imu.back().sampled_at) return;
  if (imu.size() >= kMostSamples) begin();
  calm_.add(sample);
  if (!has_begun_) await_calm();
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
  advise();
}

/// Of what comes before, only what is calm is kept.
void WaveGuide::await_calm() {
  has_begun_ = calm_.is_calm() && samples_.tags > 0;
  if (has_begun_ || calm_.calm_s() > 0) return;
  const CalmWatch watch = calm_;
  begin();
  calm_ = watch;
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
  static const std::array<const char*, 3> kMotions{
      "roll it about its forward axis", "pitch it up and down", "turn it left and right"};
  std::size_t least = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    progress_.turned[axis] = share(turned_s_[axis], kTurnedEnough_s);
    if (progress_.turned[axis] < progress_.turned[least]) least = axis;
  }
  progress_.shaken = share(shaken_s_, kShakenEnough_s);
  progress_.seen = share(seen_s_, kSeenEnough_s);
  progress_.is_enough =
      has_begun_ && progress_.turned[least] >= 1 && progress_.shaken >= 1 && progress_.seen >= 1;
  if (progress_.is_enough) {
    progress_.hint = "Enough: it is solved for.";
  } else if (samples_.imu.empty()) {
    progress_.hint = "Nothing has come from the IMU yet.";
  } else if (!has_begun_) {
    progress_.hint = "Hold it still for a second, with tags in view.";
  } else if (progress_.turned[least] < 1) {
    progress_.hint =
        std::string("Quickly to and fro, with the tags in view: ") + kMotions[least] + ".";
  } else if (progress_.shaken < 1) {
    progress_.hint = "Shake it: quickly forward and back, to the sides, up and down.";
  } else {
    progress_.hint = "Go on, with the tags in view.";
  }
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
        "It begins in motion, and may be centimetres off: hold it still before tags "
        "for a second first.");
  if (calibration.time.at_border)
    all.emplace_back("The stamps of camera and IMU are further apart than was searched.");
  else if (!calibration.time.determined || calibration.time.sigma_s > kGoodTime_s)
    all.emplace_back("The camera's clock is not known to a millisecond: turn quickly to and fro.");
  return all;
}

}  // namespace fiducap
