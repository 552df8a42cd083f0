#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"

namespace fiducap {

/// Cameras whose images all come later than what was given out already: no stall, but a clock that
/// is told far too early. From then on their images are looked at after all, but not used, until
/// they come in time again for as long.
class LateImages final {
 public:
  enum class Change { kNone, kOnlyWatched, kInTime };

  explicit LateImages(std::size_t cameras) : cameras_(cameras) {}

  /// An image has come. @param stamp  the device's
  /// @param newest_imu  of the readings that came before it
  /// @return what the camera is from the next image on
  [[nodiscard]] Change note(int camera, Instant stamp, bool was_dropped, Instant newest_imu);
  /// What to tell a person when a camera is only watched from now on, once; empty: no news.
  [[nodiscard]] std::string take_news(int camera);

  /// @param stamp  the device's, of one of its images
  [[nodiscard]] bool only_watches(int camera, Instant stamp) const {
    const Camera& of = cameras_[static_cast<std::size_t>(camera)];
    return of.only_watched || (of.watched_until && stamp <= *of.watched_until);
  }
  [[nodiscard]] bool watches_any() const {
    return std::any_of(cameras_.begin(), cameras_.end(),
                       [](const Camera& camera) { return camera.only_watched; });
  }

 private:
  struct Camera {
    int in_a_row{0};  ///< Late ones; while it is only watched: those in time.
    Instant since{};
    bool only_watched{false};
    bool is_told{false};
    Duration behind{};  ///< The IMU's readings that came before.
    /// Images that were on their way then were placed by the wrong clock.
    std::optional<Instant> watched_until{};
  };
  std::vector<Camera> cameras_;
};

}  // namespace fiducap
