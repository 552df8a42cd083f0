#include "pipeline/late_images.hpp"

#include <fmt/format.h>

#include <utility>

namespace fiducap {

namespace {
constexpr int kAllOfThem = 50;
constexpr Duration kForLong = std::chrono::seconds(2);
constexpr Duration kInTime = std::chrono::milliseconds(200);  // well within the merger's window
}  // namespace

LateImages::Change LateImages::note(int camera, Instant stamp, bool was_dropped,
                                    Instant newest_imu) {
  if (camera < 0 || static_cast<std::size_t>(camera) >= cameras_.size()) return Change::kNone;
  Camera& of = cameras_[static_cast<std::size_t>(camera)];
  const bool counts = of.only_watched ? newest_imu - stamp < kInTime : was_dropped;
  if (!counts || of.in_a_row == 0) of.since = stamp;
  of.in_a_row = counts ? of.in_a_row + 1 : 0;
  if (of.in_a_row < kAllOfThem || stamp - of.since < kForLong) return Change::kNone;
  of.in_a_row = 0;
  of.only_watched = !of.only_watched;
  if (of.only_watched) {
    of.behind = newest_imu - stamp;
    return Change::kOnlyWatched;
  }
  of.is_told = false;
  of.watched_until = stamp;
  return Change::kInTime;
}

std::string LateImages::take_news(int camera) {
  Camera& of = cameras_[static_cast<std::size_t>(camera)];
  if (!of.only_watched || std::exchange(of.is_told, true)) return {};
  return fmt::format(
      "images of camera {} are stamped {:.2f} s before readings of the IMU that came earlier: they "
      "are too late to be used, and poses are withheld. Correct bodies[].cameras[].time_shift_s, "
      "or what sets the clocks of camera and IMU; turn the body about all three axes, and it is "
      "said by how much they are off",
      camera, to_seconds(of.behind));
}

}  // namespace fiducap
