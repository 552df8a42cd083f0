#include "pipeline/imu_silence.hpp"

#include <algorithm>
#include <utility>

namespace fiducap {

namespace {

constexpr Duration kSilent = std::chrono::milliseconds(500);
// No reading of so long a time was as new as the images: neither jitter nor a burst.
constexpr Duration kLagging = std::chrono::milliseconds(100);
constexpr Duration kLagPeriod = std::chrono::milliseconds(100);

}  // namespace

void ImuSilence::reading_came(Instant sampled_at) {
  if (!newest_image_) return;
  came_at_ = newest_image_;
  if (sampled_at - lag_.since > kLagPeriod || sampled_at < lag_.since)
    lag_before_ = std::exchange(lag_, {.since = sampled_at});
  lag_.least = std::min(lag_.least, *newest_image_ - sampled_at);
}

void ImuSilence::image_used(Instant exposed_at, Instant stamp) {
  if (!used_at_) used_at_ = exposed_at;
  const Duration uncovered = exposed_at - *used_at_;
  lags_ = uncovered > kLagging && std::min(lag_.least, lag_before_.least) > kLagging && came_at_ &&
          stamp - *came_at_ < kSilent;
  is_silent_ = lags_ || uncovered > kSilent;
}

std::string_view ImuSilence::take_news() {
  if (is_silent_ == told_silent_) return {};
  told_silent_ = is_silent_;
  if (!is_silent_) return "the IMU is back";
  if (lags_)
    return "images are stamped later than all readings of the IMU: poses are withheld. Look at "
           "what sets the clocks of camera and IMU, and whether readings come late";
  return "the IMU is silent: images are used without it, poses between them are guesses. Look at "
         "its cable, driver and clock";
}

}  // namespace fiducap
