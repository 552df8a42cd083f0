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

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "daemon/recording/session_writer.hpp"
#include "pipeline/body_update.hpp"

namespace fiducap {

struct RecorderConfig {
  /// Each session is a folder in it, each body a recording in that. Empty: `recordings` in the
  /// working directory.
  std::string folder;
  bool images{false};  ///< False: the detected corners and the IMU, enough for `fiducap replay`.
  /// A session of this name (`-2` and so on behind it when there is one) begins with the server,
  /// before the first sample: its replay gives the same estimates. Empty: none does.
  std::string at_start{};
};

/// What a session carries beside its samples, so that a replay starts from what the server had.
struct SessionSurroundings {
  std::string config_yaml;             ///< Effective, without secrets.
  std::function<MapView()> published;  ///< The map just now.
  bool is_refined{false};              ///< Refinements of the map will be told.
};

/// Writes the sensors of all bodies to disk while the server runs. Only `run`, on a thread of its
/// own, touches the disk, and at most a second of what it wrote is lost with the process.
/// Everything else returns at once, whatever the disk does: a session's samples wait in memory
/// until its files are open, and are dropped and counted when too many wait (RecordingQueue). What
/// goes wrong is in `recordings` and on the event board.
class SessionRecorder final {
 public:
  /// @param clock, events  outlive the recorder
  SessionRecorder(RecorderConfig config, const Clock& clock, EventBoard& events);

  /// Before the first `take`, in the order of the bodies. @param info  `folder` and `has_…` are
  /// filled in here
  void add_body(const std::string& name, RecordingInfo info, SimulatedTruth truth = {});
  /// Before the first `start`.
  void set_surroundings(SessionSurroundings surroundings) {
    surroundings_ = std::move(surroundings);
  }

  /// @param name  of the session; a plain folder name
  Expected<void> start(const std::string& name);
  /// Before `run`, and on a thread that may wait for the disk: says whether it took the files. The
  /// session is called `name`, or `name-2` and so on when there are such recordings already.
  Expected<void> start_and_open(const std::string& name);
  /// What was taken until now is still written, then the files are closed.
  Expected<void> stop();
  /// Between start and stop, and until it fails.
  [[nodiscard]] std::optional<std::string> current() const;
  /// The newest last, at most 8.
  [[nodiscard]] std::vector<RecordingStatus> recordings() const;

  /// From any thread. Images are taken only when they are configured.
  void take(std::size_t body, const SensorSample& sample);
  /// Corners that were found in an image, where images are not recorded; costs nothing when nothing
  /// is recorded.
  void take_found(std::size_t body, const CornerFrame& found);
  /// How the image's body and the map met.
  void take_turn(std::size_t body, const BodyUpdate& update, const MapView& view,
                 std::uint64_t turn);
  /// When all bodies' map was refined.
  void take_refinement(const RefinementTurn& turn);

  /// The writer: runs until stopped and everything is on disk.
  void run(std::stop_token stop);
  /// After `run` was asked to stop: waits for its end as long as the disk takes something, at most
  /// 20 s.
  /// @return false: the disk is stuck; what is lost was said
  [[nodiscard]] bool ends() const;

 private:
  enum class Slowness { kNone, kStuck, kDropping };

  [[nodiscard]] std::string free_name(const std::string& name) const;
  [[nodiscard]] Expected<void> admit(const std::string& name) const;
  [[nodiscard]] bool is_under_way() const;
  void end_current();
  void put(std::size_t body, RecordedThing what);
  void say_slow(Slowness how);
  void say_when_caught_up();
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
  std::atomic<std::int64_t> progress_ns_{0};  ///< When the disk took something last.
  std::atomic<bool> ended_{false};
};

}  // namespace fiducap
