#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/event_board.hpp"
#include "base/time.hpp"
#include "capture/recording/recording_writer.hpp"
#include "capture/sensor_source.hpp"
#include "pipeline/replay/map_turns.hpp"
#include "streaming/operator_api.hpp"

namespace fiducap {

/// State of one recording of all bodies, shared by workers, writer and operator without a lock.
class RecordedSession final {
 public:
  using State = RecordingStatus::State;

  explicit RecordedSession(std::string name) : name_(std::move(name)) {}

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] bool is_over() const {
    return state_ == State::kFinished || state_ == State::kFailed;
  }

  /// Its files are open; no effect if it is stopping already.
  void opened() {
    State starting = State::kStarting;
    state_.compare_exchange_strong(starting, State::kRecording);
  }
  /// No effect if it has failed.
  void stopping() {
    for (State now = state_; now != State::kFailed;)
      if (state_.compare_exchange_weak(now, State::kStopping)) return;
  }
  void finished() { state_ = State::kFinished; }
  /// Once, by the writer.
  void failed(std::string reason) {
    reason_ = std::move(reason);
    state_ = State::kFailed;  // publishes the reason
  }

  void on_disk(std::uint64_t samples, std::uint64_t bytes) {
    samples_ = samples;
    bytes_ = bytes;
  }
  void on_disk(std::uint64_t bytes) { bytes_ = bytes; }
  void drop() { ++dropped_; }

  [[nodiscard]] RecordingStatus status() const {
    const State state = state_;
    return {name_, state, state == State::kFailed ? reason_ : "", samples_, bytes_, dropped_};
  }

 private:
  const std::string name_;
  std::atomic<State> state_{State::kStarting};
  std::string reason_;
  std::atomic<std::uint64_t> samples_{0};
  std::atomic<std::uint64_t> bytes_{0};
  std::atomic<std::uint64_t> dropped_{0};
};

/// Ground truth of a simulated body, recorded beside its samples.
struct SimulatedTruth {
  std::function<TruthSample(Instant)> at;
  std::vector<RecordedTag> tags;
  std::vector<Pose> X_BV;
};

/// Metadata of a body's recording. `info.name` is its folder within the session.
struct RecordedBody {
  RecordingInfo info;
  SimulatedTruth truth;
};

/// Initial state for a replay.
struct SessionStart {
  std::string config_yaml;     ///< Effective, without secrets.
  std::optional<MapView> map;  ///< At the start.
};

/// Writes the folder of one session: a recording per body, `config.yaml`, `map.yaml`, `turns.csv`,
/// and `refinements.csv`. Every call may wait for the disk.
class SessionFiles final {
 public:
  /// @param folder  must not exist: nothing is overwritten
  /// @param bodies  outlive the files
  [[nodiscard]] static Expected<SessionFiles> create(const std::filesystem::path& folder,
                                                     const std::vector<RecordedBody>& bodies,
                                                     const SessionStart& start);

  [[nodiscard]] Expected<void> write(std::size_t body, const SensorSample& sample);
  /// With the ground truth at its time, if there is one.
  [[nodiscard]] Expected<void> write(MapTurn turn);
  [[nodiscard]] Expected<void> write(const RefinementTurn& turn);
  /// Written samples survive the end of the process.
  [[nodiscard]] Expected<void> flush();
  [[nodiscard]] Expected<void> close();
  /// On disk.
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  explicit SessionFiles(const std::vector<RecordedBody>& bodies) : bodies_(bodies) {}
  [[nodiscard]] Expected<void> open_body(const std::filesystem::path& folder,
                                         const RecordedBody& body);
  [[nodiscard]] Expected<void> open_surroundings(const std::filesystem::path& folder,
                                                 const SessionStart& start);

  std::reference_wrapper<const std::vector<RecordedBody>> bodies_;
  std::vector<RecordingWriter> writers_;
  std::optional<TurnWriter<MapTurn>> turns_;
  std::optional<TurnWriter<RefinementTurn>> refinements_;
  std::uint64_t first_revision_{};
  std::uint64_t surroundings_bytes_{};
};

struct SessionEnd {};
using RecordedThing = std::variant<SessionStart, SessionEnd, SensorSample, MapTurn, RefinementTurn>;

struct RecordedItem {
  std::shared_ptr<RecordedSession> session;
  std::size_t body{};
  RecordedThing what;
  std::size_t bytes{0};  ///< The queue's.
};

inline constexpr const char* kRecorder = "recorder";  ///< Subject of events and log.

/// Writes queued items; nothing else uses the disk of the recordings. Flushes every second, so that
/// a killed server loses no more. A session that fails is over; its files stay.
class SessionWriter final {
 public:
  /// @param folder  of the sessions' folders
  /// @param bodies, clock, events  outlive the writer
  SessionWriter(std::filesystem::path folder, const std::vector<RecordedBody>& bodies,
                const Clock& clock, EventBoard& events)
      : folder_(std::move(folder)), bodies_(bodies), clock_(clock), events_(events) {}

  /// May wait for the disk. A failure ends the session and is reported.
  void write(const RecordedItem& item) noexcept;
  void flush_when_due() noexcept;
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// A session's files are open.
  [[nodiscard]] bool is_open() const { return files_.has_value(); }

 private:
  [[nodiscard]] Expected<void> carry_out(const RecordedItem& item);
  [[nodiscard]] Expected<void> open(const std::shared_ptr<RecordedSession>& session,
                                    const SessionStart& start);
  [[nodiscard]] Expected<void> finish();
  void give_up(RecordedSession& session, const Error& why);

  std::filesystem::path folder_;
  const std::vector<RecordedBody>& bodies_;
  const Clock& clock_;
  EventBoard& events_;
  std::shared_ptr<RecordedSession> session_;  ///< Whose files are open.
  std::optional<SessionFiles> files_;
  std::uint64_t written_{0};  ///< Samples given to `files_`.
  Instant flushed_at_{};
  bool failing_{false};
};

}  // namespace fiducap
