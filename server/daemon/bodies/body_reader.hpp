#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "base/event_board.hpp"
#include "base/time.hpp"
#include "capture/image_watch.hpp"
#include "capture/sample_merger.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/bodies/unseen_tags.hpp"

namespace fiducap {

/// Pauses between attempts: doubled with each one up to half a minute, short again once an attempt
/// has lasted for a minute.
class Backoff final {
 public:
  explicit Backoff(Duration shortest) : shortest_(shortest), next_(shortest) {}

  void lasted(Duration time) {
    if (time >= std::chrono::minutes(1)) next_ = shortest_;
  }
  /// @return how long to wait before the next attempt
  [[nodiscard]] Duration pause() {
    return std::exchange(next_, std::min<Duration>(2 * next_, std::chrono::seconds(30)));
  }
  [[nodiscard]] Duration pause_after(Duration time) {
    lasted(time);
    return pause();
  }

 private:
  Duration shortest_;
  Duration next_;
};

/// Liveness of a body's samples: written by its threads, read by the health watch. Server time; 0:
/// none yet.
struct BodyPulse {
  std::atomic<std::int64_t> image_came_ns{0};
  std::array<std::atomic<std::int64_t>, kMostCameras> camera_came_ns{};  ///< Of each camera.
  std::atomic<std::int64_t> lateness_ns{0};  ///< Of the last image: middle of exposure → corrected.
  std::atomic<std::int64_t> on_the_way_ns{0};  ///< … middle of exposure → arrived here.
  std::atomic<std::uint64_t> images{0};        ///< Arrived.
  std::atomic<std::uint64_t> skipped{0};       ///< Of those: dropped for lack of time.
  std::atomic<bool> ended{false};              ///< No more samples.
  UnseenTags unseen;                           ///< Images without tags, and the reason.
};

/// A sample on its way to the worker.
struct Delivery {
  SensorSample sample;
  Instant arrived{};  ///< Server time.
};

/// Queue between a body's readers and its worker, in order of arrival. Bounded: when images pile
/// up, the oldest is dropped. IMU readings are never dropped singly; on overflow (seconds of them)
/// the queue is cleared. The lock is held for a push or a swap only.
class BodyInbox final {
 public:
  static constexpr std::size_t kMaxImu = 4096;

  explicit BodyInbox(std::size_t max_images);

  /// @return false when the inbox is closed or finished
  bool push(SensorSample sample, Instant arrived);
  /// No more samples; those that wait can still be taken.
  void finish();
  /// Nothing can be taken any more.
  void close();
  /// Lets take() return once, also without samples.
  void wake();
  /// Waits for samples and swaps them into `out`, which is emptied first.
  /// @return false when exhausted, closed or stopped
  [[nodiscard]] bool take(std::vector<Delivery>& out, std::stop_token stop);
  void clear();
  /// How often the queue was cleared because of IMU readings.
  [[nodiscard]] std::uint64_t overflows() const;
  [[nodiscard]] std::uint64_t images_dropped() const;

 private:
  void set_and_notify(bool& flag);

  mutable std::mutex mutex_;
  std::condition_variable_any filled_;
  std::vector<Delivery> waiting_;
  std::size_t max_images_;
  std::size_t images_{0};
  std::uint64_t images_dropped_{0};
  std::uint64_t overflows_{0};
  bool finished_{false};
  bool woken_{false};
  bool closed_{false};
};

/// One of a body's sources.
struct BodySource {
  std::unique_ptr<SensorSource> samples;
  std::string name{"source"};  ///< For messages, after `its`.
  bool gives_images{true};     ///< When the last of these has ended, so has the body.
  /// Expectations for its images, by camera of the body; other cameras are not checked.
  std::vector<ImageWatch::Nominal> nominal{};
};

/// Reads one source of a body; a plain function for a thread to run. Faulty images (black, frozen,
/// incomplete, too few) are reported. An exception is reported, and reading continues after pauses
/// that grow to half a minute.
class BodyReader final {
 public:
  /// @return false: no more samples are taken
  using Take = std::function<bool(SensorSample)>;

  BodyReader(BodySource source, std::string body, Take take, EventBoard& events,
             const Clock& clock);

  /// Until the source ends, fails or is stopped, or no more samples are taken.
  void read(std::stop_token stop);
  /// read() has not returned. From any thread.
  [[nodiscard]] bool reading() const { return reading_; }
  [[nodiscard]] bool gives_images() const { return source_.gives_images; }

 private:
  void read_samples(std::stop_token stop);
  void check(const CameraFrame& image);
  void report(std::size_t camera, const ImageCondition& doubt);
  void report_failure(const char* why);

  BodySource source_;
  std::string body_;
  Take take_;
  EventBoard& events_;
  const Clock& clock_;
  std::atomic<bool> reading_{true};
  bool failed_{false};               ///< No sample since the last failure.
  std::vector<ImageWatch> watches_;  ///< By camera of the body.
};

}  // namespace fiducap
