#include "estimation/start/start_log.hpp"

#include <algorithm>

namespace fiducap {

namespace {
constexpr Duration kBeforeFirstTag = std::chrono::seconds(1);
constexpr double kLongest_s = 15.0;
constexpr double kLongestWithoutImage_s = 4.0;
// Fifteen seconds of a camera at 100 Hz; of ten tags in each image of a usual one, of an IMU at
// 2 kHz: together some megabytes.
constexpr std::size_t kMostImages = 1500;
constexpr std::size_t kMostSightings = 10'000;
constexpr std::size_t kMostReadings = 30'000;
}  // namespace

void StartLog::add(const ImuSample& imu) {
  if (images_.empty() && !imu_.empty() &&
      imu.sampled_at - imu_.front().sampled_at > 2 * kBeforeFirstTag) {
    std::erase_if(imu_, [&](const ImuSample& old) {
      return imu.sampled_at - old.sampled_at > kBeforeFirstTag;
    });
  }
  if (!is_full()) imu_.push_back(imu);
}

void StartLog::add(const TagObservations& seen, const MapKnowledge& map) {
  if (is_full() || (images_.empty() && seen.tags.empty())) return;
  sightings_ += seen.tags.size();
  images_.push_back({seen, {map.tags.begin(), map.tags.end()}, map.may_define_workspace});
}

bool StartLog::is_full() const {
  if (images_.empty()) return imu_.size() >= kMostReadings;
  const Instant image = images_.back().seen.exposed_at;
  const Instant newest = imu_.empty() ? image : std::max(image, imu_.back().sampled_at);
  return seconds_since_first_tag(newest) > kLongest_s ||
         to_seconds(newest - image) > kLongestWithoutImage_s || images_.size() >= kMostImages ||
         sightings_ >= kMostSightings || imu_.size() >= kMostReadings;
}

double StartLog::seconds_since_first_tag(Instant now) const {
  return images_.empty() ? 0.0 : to_seconds(now - images_.front().seen.exposed_at);
}

}  // namespace fiducap
