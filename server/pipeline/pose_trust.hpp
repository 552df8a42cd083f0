#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "estimation/body_estimate.hpp"

/// Checks that withhold poses.
namespace fiducap {

/// Publishes poses only after images and IMU have fitted together for a while.
///
/// New map: axes may be wrong, a clock far off, or the start on the wrong branch, and the first
/// images fit all of these. Before cameras and gyro were found to agree, one inconsistent image
/// restarts the validation window (for 10 s at most). Known map: poses from the first image on. A
/// body that hardly turns has poses as long as its images fit. After relocalisation the images
/// have to fit again; after a return by a single tag, that tag has to fit for half a second.
class PoseTrust final {
 public:
  /// Every image.
  /// @param is_established  all cameras agree with the gyro
  /// @param is_room_known   tags in view are in the map, and not by this body alone
  void add(const UpdateReport& report, bool is_established, bool is_room_known);
  /// The images so far had wrong stamps and do not count.
  void note_clock_jump();

  [[nodiscard]] bool withholds() const { return stage_ != Stage::kTrusted; }
  /// Only because of too few images: nothing has contradicted.
  [[nodiscard]] bool is_untested() const {
    return stage_ == Stage::kNew || stage_ == Stage::kReturned;
  }
  /// A contradiction has lasted for three seconds and has no message of its own.
  [[nodiscard]] bool is_contradicted() const;

 private:
  enum class Stage { kNew, kContradicted, kTrusted, kReturned };

  void forget_fits();
  void contradict();
  void trust();

  Stage stage_{Stage::kNew};
  unsigned last_{0};  ///< One bit per image with usable tags, newest lowest: it contradicts.
  std::optional<Instant> first_image_;  ///< Of a new room.
  int fits_{0};                         ///< Fitting images since the last contradiction.
  std::optional<Instant> first_fit_;
  Instant now_{};
  Instant contradicted_since_{};
  bool is_explained_{false};  ///< The contradiction, by a message of its own.
  bool was_lost_{false};      ///< Relocalised or restarted: agreement of the axes is not enough.
  int generation_{-1};
};

/// @param is_established  see PoseTrust::add
[[nodiscard]] std::string contradiction_text(bool is_established);

/// Detects cameras whose images are all stamped before samples that were given out already: not a
/// delay, but a wrong clock. Their images are then compared with the gyro but not used, until they
/// are in time for as long.
class LateImages final {
 public:
  enum class Change { kNone, kExcluded, kInTime };

  explicit LateImages(std::size_t cameras) : cameras_(cameras) {}

  /// An image has arrived. @param stamp  the device's
  /// @param newest_imu  of the readings that arrived before it
  /// @return state of the camera from the next image on
  [[nodiscard]] Change note(int camera, Instant stamp, bool was_dropped, Instant newest_imu);
  /// Message about an excluded camera. @pre is_excluded(camera)
  [[nodiscard]] std::string text(int camera) const;

  [[nodiscard]] bool is_excluded(int camera) const {
    return cameras_[static_cast<std::size_t>(camera)].is_excluded;
  }
  /// @param stamp  the device's, of one of its images
  [[nodiscard]] bool excludes(int camera, Instant stamp) const {
    const Camera& of = cameras_[static_cast<std::size_t>(camera)];
    return of.is_excluded || (of.excluded_until && stamp <= *of.excluded_until);
  }
  [[nodiscard]] bool excludes_any() const {
    return std::ranges::any_of(cameras_, [](const Camera& camera) { return camera.is_excluded; });
  }

 private:
  struct Camera {
    int in_a_row{0};  ///< Late images; while excluded: images in time.
    Instant since{};
    bool is_excluded{false};
    Duration behind{};  ///< The newest IMU reading.
    /// Images that were still queued had been stamped by the wrong clock.
    std::optional<Instant> excluded_until{};
  };
  std::vector<Camera> cameras_;
};

/// Whether IMU readings reach up to the images and, if not, whether the IMU is silent or one of the
/// clocks is wrong (readings arrive, but all of them are older).
class ImuSilence final {
 public:
  /// On arrival, in any order. @param stamp  the device's
  void image_arrived(Instant stamp) { newest_image_ = stamp; }
  void reading_arrived(Instant sampled_at);

  /// When used, in order.
  void reading_used(Instant sampled_at) { used_at_ = sampled_at; }
  void image_used(Instant exposed_at, Instant stamp);

  [[nodiscard]] bool is_silent() const { return is_silent_; }
  /// The clocks disagree: poses must not be used.
  [[nodiscard]] bool lags() const { return lags_; }
  [[nodiscard]] std::string_view text() const;

 private:
  /// Smallest delay of readings behind the newest image, within a period.
  struct Lag {
    Instant since{};
    Duration least{Duration::max()};
  };

  std::optional<Instant> newest_image_;  ///< As stamped.
  std::optional<Instant> arrived_at_;    ///< `newest_image_` when the newest reading arrived.
  Lag lag_;                              ///< Of this period.
  Lag lag_before_;                       ///< Of the one before.
  std::optional<Instant> used_at_;
  bool is_silent_{false};
  bool lags_{false};
};

}  // namespace fiducap
