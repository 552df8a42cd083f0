#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "capture/jump_gate.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

struct MergerConfig {
  bool has_imu{true};
  int cameras{kMostCameras};  ///< So many the body has; images of others are bad.
  Duration window{std::chrono::milliseconds(
      250)};  ///< An image waits at most this long (in sample time) for its IMU samples.
  Duration jump{std::chrono::seconds(
      1)};  ///< A sample further ahead of all others waits for confirmation, see JumpGate.
  std::size_t max_images{8};  ///< More images than this waiting: the oldest goes.
  std::size_t max_imu{4096};  ///< More IMU samples than this waiting: the body is lost.
};

/// Counts of what did not pass; never reset.
struct MergerStatistics {
  std::uint64_t images_dropped{};     ///< Queue full, the oldest went.
  std::uint64_t late_dropped{};       ///< Older than what was already released.
  std::uint64_t backwards_dropped{};  ///< Time of one sensor did not increase.
  std::uint64_t far_dropped{};        ///< Far ahead, and its sensor's next sample was not.
  std::uint64_t bad_dropped{};        ///< NaN or infinite numbers, or no such camera.
  std::uint64_t
      imu_waits_expired{};  ///< Image released without the IMU sample that closes its interval.

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

/// Puts the samples of one body's sensors into the order in which the filter wants them.
///
/// Order given out: IMU samples by time; an image exposed at t comes right *after the first* IMU
/// sample at or after t, so that the filter can interpolate up to t and never has to guess. Without
/// IMU: images by time. Equal images of several cameras: by camera index. Not thread-safe: whoever
/// has it guards it.
///
/// Images come later than the IMU samples of their time, so IMU samples are held back until every
/// camera that was heard of within the window has shown that no earlier image is on its way, or
/// until the window has passed. When the IMU is silent, images do not wait until they are dropped:
/// with the queue full the oldest one goes on without. The output does not lag for that:
/// OutputPredictor gets the IMU samples before the merger does.
class SampleMerger final {
 public:
  explicit SampleMerger(const MergerConfig& config);
  /// In order of arrival. Bad, backward and late samples are counted and dropped; IMU samples are
  /// ignored when the configuration has no IMU. Allocates nothing.
  /// @return false when the IMU queue is full: the consumer is dead.
  bool push(SensorSample sample);
  /// What the filter has learned about a camera's clock: added to the time of its images, also of
  /// those that wait here, so that they wait for the IMU samples of the moment at which they were
  /// really exposed. Replaces the last one.
  void set_clock_shift(int camera, Duration shift);
  /// Nothing more will come: `pop` gives the rest without waiting.
  void finish();
  /// @return nullopt when the next sample must still wait.
  [[nodiscard]] std::optional<SensorSample> pop();
  [[nodiscard]] MergerStatistics statistics() const;

 private:
  [[nodiscard]] bool is_good(const SensorSample& sample) const;
  bool admit(SensorSample sample);
  bool admit_imu(const ImuSample& sample);
  void admit_image(SensorSample sample);
  [[nodiscard]] bool is_late(Instant image) const;
  SensorSample take_imu();
  SensorSample take_image();
  void see(Instant at);
  [[nodiscard]] bool has_passed_window(Instant at) const;
  [[nodiscard]] bool some_camera_is_alive() const;
  [[nodiscard]] bool no_camera_owes_an_image_before(Instant at) const;
  [[nodiscard]] bool image_is_due() const;
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

/// @return whose image, or corners, it is; -1: it is none
[[nodiscard]] int camera_of(const SensorSample& sample);
/// False: there is a number that is none.
[[nodiscard]] bool has_finite_corners(const CornerFrame& frame);

}  // namespace fiducap
