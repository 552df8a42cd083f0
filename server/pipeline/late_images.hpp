#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "base/time.hpp"

namespace fiducap {

/// Cameras whose images all come later than what was given out already: no stall, but a clock that
/// is told far too early. From then on their images are looked at after all, but not used.
class LateImages final {
 public:
  explicit LateImages(std::size_t cameras) : cameras_(cameras) {}

  /// An image has come. @param stamp  the device's
  /// @param newest_imu  of the readings that came before it
  /// @return the camera is only watched from here on
  bool note(int camera, Instant stamp, bool was_dropped, Instant newest_imu) {
    if (camera < 0 || static_cast<std::size_t>(camera) >= cameras_.size()) return false;
    Camera& of = cameras_[static_cast<std::size_t>(camera)];
    if (!was_dropped || of.late_in_a_row == 0) of.since = stamp;
    of.late_in_a_row = was_dropped ? of.late_in_a_row + 1 : 0;
    if (of.late_in_a_row < kAllAreLate || stamp - of.since < kForLong) return false;
    of.late_in_a_row = 0;
    of.only_watched = true;
    of.behind = newest_imu - stamp;
    return true;
  }
  /// What to tell a person when a camera is only watched from now on, once; empty: no news.
  [[nodiscard]] std::string take_news(int camera);

  [[nodiscard]] bool only_watches(int camera) const {
    return cameras_[static_cast<std::size_t>(camera)].only_watched;
  }
  [[nodiscard]] bool watches_any() const {
    return std::any_of(cameras_.begin(), cameras_.end(),
                       [](const Camera& camera) { return camera.only_watched; });
  }

 private:
  static constexpr int kAllAreLate = 50;
  static constexpr Duration kForLong = std::chrono::seconds(2);

  struct Camera {
    int late_in_a_row{0};
    Instant since{};
    bool only_watched{false};
    bool is_told{false};
    Duration behind{};  ///< The IMU's readings that came before.
  };
  std::vector<Camera> cameras_;
};

}  // namespace fiducap
