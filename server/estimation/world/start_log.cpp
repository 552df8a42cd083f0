#include "estimation/world/start_log.hpp"

#include <algorithm>

namespace fiducap::world {

namespace {
constexpr Duration kBeforeFirstTag = std::chrono::seconds(1);
constexpr double kLongest_s = 10.0;
// Ten seconds of a camera at 100 Hz; of ten tags in each image of a usual one; of an IMU at 4 kHz.
constexpr std::size_t kMostImages = 1000;
constexpr std::size_t kMostSightings = 10'000;
constexpr std::size_t kMostReadings = 40'000;
}  // namespace

void StartLog::add(const ImuSample& imu) {
  if (!open_) return;
  if (images_.empty() && !imu_.empty() &&
      imu.sampled_at - imu_.front().sampled_at > 2 * kBeforeFirstTag) {
    std::erase_if(imu_, [&](const ImuSample& old) {
      return imu.sampled_at - old.sampled_at > kBeforeFirstTag;
    });
  }
  if (!is_full()) imu_.push_back(imu);
}

void StartLog::add(const TagObservations& seen, std::span<const KnownTag> known) {
  if (!open_ || (images_.empty() && seen.tags.empty())) return;
  if (is_full()) return;
  sightings_ += seen.tags.size();
  images_.push_back({seen, {known.begin(), known.end()}});
}

bool StartLog::is_full() const {
  if (images_.empty()) return imu_.size() >= kMostReadings;
  Instant newest = images_.back().seen.exposed_at;
  if (!imu_.empty()) newest = std::max(newest, imu_.back().sampled_at);
  return seconds_since_first_tag(newest) > kLongest_s || images_.size() >= kMostImages ||
         sightings_ >= kMostSightings || imu_.size() >= kMostReadings;
}

double StartLog::seconds_since_first_tag(Instant now) const {
  return images_.empty() ? 0.0 : to_seconds(now - images_.front().seen.exposed_at);
}

void StartLog::shift_images(std::span<const double> shifts_s) {
  for (Image& image : images_) {
    const Duration shift = from_seconds(shifts_s[static_cast<std::size_t>(image.seen.camera)]);
    image.seen.exposed_at += shift - image.seen.clock_shift;
    image.seen.clock_shift = shift;
  }
  std::stable_sort(images_.begin(), images_.end(), [](const Image& a, const Image& b) {
    return a.seen.exposed_at < b.seen.exposed_at;
  });
}

void StartLog::close() {
  open_ = false;
  imu_ = {};
  images_ = {};
  sightings_ = 0;
}

}  // namespace fiducap::world
