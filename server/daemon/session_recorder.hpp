#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <variant>
#include <vector>

#include "base/config_check.hpp"
#include "capture/recording/recording_writer.hpp"
#include "pipeline/body_update.hpp"
#include "pipeline/replay/map_turns.hpp"

namespace fiducap {

struct RecorderConfig {
  /// Each session is a folder in it, each body a recording in that. Empty: `recordings` in the
  /// working directory.
  std::string folder;
  bool images{false};  ///< False: the detected corners and the IMU, enough for `fiducap replay`.
  /// A session of this name begins with the server, before the first sample: its replay gives the
  /// same estimates. Empty: none does.
  std::string at_start{};
};

/// The truth about a simulated body, recorded beside its samples.
struct SimulatedTruth {
  std::function<TruthSample(Instant)> at;
  std::vector<RecordedTag> tags;
  std::vector<Pose> X_BV;
};

/// What a session carries beside its samples, so that a replay starts from what the server had.
struct SessionSurroundings {
  std::string config_yaml;             ///< Effective, without secrets.
  std::function<MapView()> published;  ///< The map just now.
};

/// Writes the sensors of all bodies to disk while the server runs. `take` costs one atomic read
/// when nothing is recorded, and never waits for the disk: when the disk does not keep up, samples
/// are dropped and counted.
class SessionRecorder final {
 public:
  static constexpr std::size_t kMaxWaiting = 20000;
  static constexpr std::size_t kMaxWaiting_bytes = std::size_t{256} << 20;  ///< Of images.

  explicit SessionRecorder(RecorderConfig config) : config_(std::move(config)) {}

  /// Before the first `take`, in the order of the bodies. @param info  `folder` and `has_…` are
  /// filled in here
  void add_body(const std::string& name, RecordingInfo info, SimulatedTruth truth = {});
  /// Before the first `start`.
  void set_surroundings(SessionSurroundings surroundings) {
    surroundings_ = std::move(surroundings);
  }

  /// @param name  of the session; a plain folder name, new
  Expected<void> start(const std::string& name);
  /// What was taken until now is written, then the files are closed.
  Expected<void> stop();
  [[nodiscard]] std::optional<std::string> current() const;

  /// From any thread. Images are taken only when they are configured.
  void take(std::size_t body, const SensorSample& sample);
  /// Corners that were found in an image, where images are not recorded; costs nothing when nothing
  /// is recorded.
  void take_found(std::size_t body, const CornerFrame& found);
  /// How the image's body and the map met.
  void take_turn(std::size_t body, const BodyUpdate& update, const MapView& view,
                 std::uint64_t turn);
  /// The writer: runs until stopped and everything is on disk.
  void run(std::stop_token stop);

 private:
  struct Session {
    std::string name;
    std::vector<RecordingWriter> writers;
    std::optional<MapTurnWriter> turns;
    std::uint64_t first_revision{};
    std::atomic<std::uint64_t> dropped{0};
    bool failed{false};  ///< Said once; only the writer touches it.
  };
  struct Item {
    std::shared_ptr<Session> session;
    std::size_t body{};
    std::variant<std::monostate, SensorSample, MapTurn> what;  ///< Nothing: the session ends.
    std::size_t image_bytes{};
  };
  void put(std::size_t body, std::variant<std::monostate, SensorSample, MapTurn> what);
  Expected<void> write_surroundings(const std::filesystem::path& folder, Session& session);
  void write(Item& item);
  Expected<void> write_or_finish(Item& item);

  RecorderConfig config_;
  SessionSurroundings surroundings_;
  std::vector<RecordingInfo> bodies_;
  std::vector<SimulatedTruth> truths_;
  std::atomic<bool> recording_{false};
  mutable std::mutex mutex_;
  std::condition_variable_any filled_;
  std::shared_ptr<Session> session_;
  std::vector<Item> waiting_;
  std::atomic<std::size_t> waiting_bytes_{0};  ///< Images that are not on disk yet.
};

}  // namespace fiducap
