#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fiducap/client.hpp"

/// Changes of a Fiducap server's state: bodies, map, recording. Needs the operator's token
/// (`operator.token` in the server's configuration), which is never transmitted: each command
/// proves its knowledge.
namespace fiducap {

struct ControlOptions {
  std::string server{"127.0.0.1"};  ///< Address or host name.
  std::uint16_t port{21600};        ///< Same number as for poses, TCP.
  std::string token;
  std::chrono::milliseconds timeout{2000};  ///< Of one command, with connecting if necessary.
};

/// A body of the server; disabled ones are not in frames.
struct ControlledBody {
  int id{};
  std::string name;
  bool enabled{};
  std::array<double, 3> pivot_position_m{};  ///< p_BP: of the pivot P in the body's axes B (IMU).
  std::array<double, 4> pivot_orientation_wxyz{1, 0, 0, 0};
};

enum class RecordingState {
  kStarting,  ///< Samples are accepted; the files are not open yet.
  kRecording,
  kStopping,  ///< No more samples are accepted; accepted ones are being written.
  kFinished,  ///< Everything is on disk.
  kFailed,    ///< Ended; see `reason`.
};

/// Progress or result of a recording.
struct Recording {
  std::string name;
  RecordingState state{};
  std::string reason;       ///< Cause of the failure; else empty.
  std::uint64_t samples{};  ///< On disk: IMU samples, and images or their corners.
  std::uint64_t bytes{};    ///< On disk.
  std::uint64_t dropped{};  ///< Not recorded, because the disk was slow or failed.
};

/// Measured centre of a tag in the room.
struct MeasuredTag {
  int tag_id{};
  std::array<double, 3> position_m{};  ///< Axes of the room: right-handed, z up.
};

struct ControlState {
  std::vector<ControlledBody> bodies;
  bool mapping{};         ///< The map grows and is refined; false: it is frozen.
  std::string recording;  ///< Name of the running recording; empty: none.
  /// All running ones and up to eight ended ones; the newest last.
  std::vector<Recording> recordings;
  std::int64_t map_version{};  ///< Last stored version of the served map; 0: none.
};

/// Whether a command was executed; if not, the cause in one sentence for a user.
struct Outcome {
  bool done{};
  std::string problem;
  explicit operator bool() const { return done; }
};

/// Commands over one connection, established when first needed and again after a failure. Every
/// call waits for the reply, at most the timeout. A command without a reply may have been executed.
/// Not thread-safe.
class FIDUCAP_CLIENT_API Control {
 public:
  explicit Control(ControlOptions options);
  ~Control();
  Control(const Control&) = delete;
  Control& operator=(const Control&) = delete;

  Outcome list(ControlState& state);
  Outcome set_enabled(int body_id, bool enabled);
  Outcome rename(int body_id, const std::string& name);
  Outcome set_pivot(int body_id, const std::array<double, 3>& position_m,
                    const std::array<double, 4>& orientation_wxyz);
  Outcome set_mapping(bool mapping);
  /// Stores the present map as a version. This and the next two return before the disk has
  /// finished; events of the subject `map` (events.hpp) report the result.
  /// @param name  for the history; empty: none
  Outcome commit_map(const std::string& name = {});
  Outcome name_version(std::int64_t version, const std::string& name);
  /// Serves a stored version as a new version. Refused while the map is frozen.
  Outcome roll_back(std::int64_t version);
  /// Aligns the workspace to the room. Poses and tags are then streamed in the room's axes and jump
  /// once.
  /// @param measured  at least three tags
  Outcome align_map(const std::vector<MeasuredTag>& measured);
  /// The tag stays in the map and is not used.
  Outcome quarantine_tag(int tag_id);
  /// Removes the tag from the map; seen again, it is a new one. Refused while the map is frozen.
  Outcome forget_tag(int tag_id);
  /// Returns before the files are open: `list` has the state.
  /// @param name  of the folder; empty: the date and time
  Outcome start_recording(const std::string& name = {});
  /// Returns before accepted samples are written: `list` has the state and result.
  Outcome stop_recording();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
