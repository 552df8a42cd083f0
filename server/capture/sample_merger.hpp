#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// Drops single stamps from the far future: after one of them all true samples would be late.
///
/// A sample far ahead of all others (and the first of all) waits for the next sample of its sensor,
/// or for any sample near it. If that confirms its time, both pass; otherwise it is dropped. The
/// order of a sensor's samples is preserved. Allocates nothing per sample.
class JumpGate final {
 public:
  /// @param jump  a larger step is far ahead: longer than usual pauses
  explicit JumpGate(Duration jump);

  /// @return what passes now, in order of arrival; valid until the next call
  [[nodiscard]] std::vector<SensorSample>& take(SensorSample sample);
  /// Nothing more will come. @return what still passes
  [[nodiscard]] std::vector<SensorSample>& finish();
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

 private:
  using Held = std::optional<SensorSample>;
  [[nodiscard]] bool is_far_ahead(Instant at) const { return !newest_ || at - *newest_ > jump_; }
  void pass(SensorSample sample);
  void pass_held(Held& held) {
    pass(std::move(*held));
    held.reset();
    --waiting_;
  }
  void drop(Held& held) {
    held.reset();
    --waiting_;
    ++dropped_;
  }

  Duration jump_;
  std::array<Held, 1 + kMostCameras> held_;  ///< IMU, cameras.
  int waiting_{0};
  std::optional<Instant> newest_;  ///< Of those that passed.
  std::vector<SensorSample> out_;
  std::uint64_t dropped_{0};
};

struct MergerConfig {
  bool has_imu{true};
  int cameras{kMostCameras};  ///< Of the body; images of others are bad.
  /// An image waits at most this long (in sample time) for its IMU samples.
  Duration window{std::chrono::milliseconds(250)};
  /// A sample further ahead of all others waits for confirmation, see JumpGate.
  Duration jump{std::chrono::seconds(1)};
  std::size_t max_images{8};  ///< When more wait, the oldest is dropped.
  std::size_t max_imu{4096};  ///< When more wait, the pipeline restarts.
};

/// Counts of what did not pass; never reset.
struct MergerStatistics {
  std::uint64_t images_dropped{};     ///< Queue full, the oldest was dropped.
  std::uint64_t late_dropped{};       ///< Older than what was already released.
  std::uint64_t backwards_dropped{};  ///< Time of one sensor did not increase.
  std::uint64_t far_dropped{};        ///< Far ahead, and its sensor's next sample was not.
  std::uint64_t bad_dropped{};        ///< NaN or infinite numbers, or no such camera.
  std::uint64_t imu_waits_expired{};  ///< Image released before its IMU interval was closed.

  MergerStatistics& operator+=(const MergerStatistics& other) {
    images_dropped += other.images_dropped;
    late_dropped += other.late_dropped;
    backwards_dropped += other.backwards_dropped;
    far_dropped += other.far_dropped;
    bad_dropped += other.bad_dropped;
    imu_waits_expired += other.imu_waits_expired;
    return *this;
  }
};

/// Sorts the samples of one body's sensors for its filter.
///
/// Output order: IMU samples by time; an image exposed at t right *after the first* IMU sample at
/// or after t, so that the filter interpolates up to t and never extrapolates. Without IMU: images
/// by time. Simultaneous images: by camera index. Not thread-safe.
///
/// Images arrive later than the IMU samples of their time, so IMU samples are held back until every
/// active camera has shown that no earlier image is on its way, or the window has passed. When the
/// IMU is silent and the image queue is full, the oldest image is released without its IMU samples.
/// The output does not lag: OutputPredictor gets the IMU samples before the merger.
class SampleMerger final {
 public:
  explicit SampleMerger(const MergerConfig& config);
  /// In order of arrival. Bad, backward and late samples are counted and dropped. No allocation.
  /// @return false when the IMU queue is full: the consumer is dead.
  bool push(SensorSample sample);
  /// Sets the clock offset of a camera as estimated by the filter: added to the time of its images,
  /// also of those in the queue, so that each waits for its IMU samples. Replaces the last one.
  void set_clock_shift(int camera, Duration shift);
  /// Nothing more will come: `pop` gives the rest without waiting.
  void finish() {
    for (SensorSample& admitted : gate_.finish()) (void)admit(std::move(admitted));
    finished_ = true;
  }
  /// @return nullopt when the next sample must still wait.
  [[nodiscard]] std::optional<SensorSample> pop();
  [[nodiscard]] MergerStatistics statistics() const {
    MergerStatistics all = statistics_;
    all.far_dropped = gate_.dropped();
    return all;
  }

 private:
  [[nodiscard]] bool is_good(const SensorSample& sample) const;
  bool admit(SensorSample sample) {
    if (const auto* imu = std::get_if<ImuSample>(&sample)) return admit_imu(*imu);
    admit_image(std::move(sample));
    return true;
  }
  bool admit_imu(const ImuSample& sample);
  void admit_image(SensorSample sample);
  [[nodiscard]] bool is_late(Instant image) const {
    return (released_image_ && image < *released_image_) ||
           (released_imu_before_ && image <= *released_imu_before_);
  }
  SensorSample take_image() {
    SensorSample image = std::move(images_.front());
    images_.erase(images_.begin());
    released_image_ = time_of(image);
    return image;
  }
  void note_time(Instant at) {
    if (!newest_seen_ || at > *newest_seen_) newest_seen_ = at;
  }
  [[nodiscard]] bool has_passed_window(Instant at) const {
    return newest_seen_ && *newest_seen_ - at > config_.window;
  }
  [[nodiscard]] bool images_are_complete_before(Instant at) const {
    return std::ranges::all_of(newest_image_, [&](const auto& newest) {
      return !newest || *newest >= at || has_passed_window(*newest);
    });
  }
  [[nodiscard]] bool image_is_due() const {
    if (images_.empty()) return false;
    const Instant at = time_of(images_.front());
    if (config_.has_imu && !(released_imu_ && *released_imu_ >= at)) return false;
    return finished_ || images_are_complete_before(at);
  }
  [[nodiscard]] bool imu_is_due() const;
  [[nodiscard]] bool imu_wait_is_over() const;

  MergerConfig config_;
  MergerStatistics statistics_;
  JumpGate gate_;
  std::vector<ImuSample> imu_;  ///< Ring of max_imu.
  std::size_t imu_begin_{0};
  std::size_t imu_waiting_{0};
  std::vector<SensorSample> images_;  ///< By time, then camera.
  std::array<std::optional<Instant>, kMostCameras> newest_image_;
  std::array<Duration, kMostCameras> clock_shift_{};
  std::optional<Instant> newest_imu_;
  std::optional<Instant> newest_seen_;
  std::optional<Instant> released_imu_;
  std::optional<Instant> released_imu_before_;  ///< The one before `released_imu_`.
  std::optional<Instant> released_image_;
  bool finished_{false};
};

/// @return the camera of an image or corners; -1: none
[[nodiscard]] int camera_of(const SensorSample& sample);
[[nodiscard]] bool has_finite_corners(const CornerFrame& frame);

}  // namespace fiducap
