#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "daemon/recording/session_files.hpp"
#include "pipeline/body_update.hpp"

namespace fiducap {

struct RecorderConfig {
  /// Each session is a folder in it, each body a recording in that. Empty: `recordings` in the
  /// working directory.
  std::string folder;
  bool images{false};  ///< False: the detected corners and the IMU, enough for `fiducap replay`.
  /// Name of a session (with `-2` and so on if it exists) that begins with the server, before the
  /// first sample: its replay gives the same estimates. Empty: none.
  std::string at_start{};
};

/// Initial state of a session, so that a replay starts like the server.
struct SessionSurroundings {
  std::string config_yaml;             ///< Effective, without secrets.
  std::function<MapView()> published;  ///< The present map.
};

/// Queue for the disk, bounded by memory: images and corners together kImages_bytes, everything
/// kMost_bytes. So IMU readings and turns, which are small and indispensable, are recorded for
/// minutes after the first image was dropped. New items are dropped, queued ones are kept.
///
/// `put` and `take_all` need the owner's lock, `written` none.
class RecordingQueue final {
 public:
  /// Nine seconds of one camera of 752 × 480 pixels at 60 Hz: longer than disks pause.
  static constexpr std::size_t kMost_bytes = std::size_t{256} << 20;
  static constexpr std::size_t kImages_bytes = std::size_t{192} << 20;

  /// Begin and end of a session always fit.
  /// @return false: dropped
  [[nodiscard]] bool put(RecordedItem item);
  /// All items, in order. They count until they are `written`.
  void take_all(std::deque<RecordedItem>& out);
  void written(const RecordedItem& item) { bytes_ -= item.bytes; }

  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  std::deque<RecordedItem> waiting_;
  std::atomic<std::size_t> bytes_{0};
};

/// Writes the sensors of all bodies to disk while the server runs. Only `run`, on a thread of its
/// own, uses the disk; at most a second of written data is lost with the process. All other calls
/// return at once: samples wait in memory until the files are open, and are dropped and counted
/// when too many wait (RecordingQueue). Failures are in `recordings` and on the event board.
class SessionRecorder final {
 public:
  /// @param clock, events  outlive the recorder
  SessionRecorder(RecorderConfig config, const Clock& clock, EventBoard& events);

  /// Before the first `take`, in the order of the bodies. @param info  without `folder`, `has_…`
  void add_body(const std::string& name, RecordingInfo info, SimulatedTruth truth = {});
  /// Before the first `start`.
  void set_surroundings(SessionSurroundings surroundings) {
    surroundings_ = std::move(surroundings);
  }

  /// @param name  of the session; a plain folder name
  Expected<void> start(const std::string& name);
  /// Before `run`, on a thread that may wait for the disk. The session is called `name`, or
  /// `name-2` and so on if it exists. @return Error when the files cannot be opened
  Expected<void> start_and_open(const std::string& name);
  /// Queued samples are still written, then the files are closed.
  Expected<void> stop();
  /// Between start and stop, and until it fails.
  [[nodiscard]] std::optional<std::string> current() const;
  /// The newest last, at most 8.
  [[nodiscard]] std::vector<RecordingStatus> recordings() const;

  /// From any thread. Images are taken only when they are configured.
  void take(std::size_t body, const SensorSample& sample);
  /// Detected corners, if images are not recorded; free when nothing is recorded.
  void take_found(std::size_t body, const CornerFrame& found);
  /// The order of an image's contribution to the map.
  void take_turn(std::size_t body, const BodyUpdate& update, const MapView& view,
                 std::uint64_t turn);
  /// A refinement of the map.
  void take_refinement(const RefinementTurn& turn);

  /// The writer: runs until stopped and everything is on disk.
  void run(std::stop_token stop);
  /// After `run` was asked to stop: waits for its end while the disk makes progress, at most 20 s.
  /// @return false: the disk is stuck; the loss was reported
  [[nodiscard]] bool ends() const;

 private:
  enum class Slowness { kNone, kStuck, kDropping };

  [[nodiscard]] Expected<void> admit(const std::string& name) const;
  [[nodiscard]] bool is_under_way() const;
  void end_current();
  void put(std::size_t body, RecordedThing what);
  void report_slowness(Slowness how);
  void report_caught_up();
  [[nodiscard]] bool wait_for_work(std::deque<RecordedItem>& batch, std::stop_token stop);
  void write(std::deque<RecordedItem>& batch);

  RecorderConfig config_;
  const Clock& clock_;
  EventBoard& events_;
  SessionSurroundings surroundings_;
  std::vector<RecordedBody> bodies_;

  std::atomic<bool> recording_{false};
  mutable std::mutex mutex_;  ///< Never held while the disk is waited for.
  std::condition_variable_any filled_;
  RecordingQueue queue_;
  std::shared_ptr<RecordedSession> session_;  ///< Takes samples.
  std::deque<std::shared_ptr<RecordedSession>> sessions_;
  Slowness slowness_{Slowness::kNone};

  SessionWriter writer_;  ///< Of `run`.
  std::atomic<bool> working_{false};
  std::atomic<std::int64_t> progress_ns_{0};  ///< Time of the last write.
  std::atomic<bool> ended_{false};
};

}  // namespace fiducap
