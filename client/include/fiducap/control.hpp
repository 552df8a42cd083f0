#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fiducap/client.hpp"

/// Changes of a Fiducap server's state: bodies, map, recording. Needs the operator's token
/// (`operator.token` in the server's configuration), which never travels: each command proves that
/// the sender knows it.
namespace fiducap {

struct ControlOptions {
  std::string server{"127.0.0.1"};  ///< Address or host name.
  std::uint16_t port{21600};        ///< The same number as for poses, TCP.
  std::string token;
  std::chrono::milliseconds timeout{
      2000};  ///< Of one command, with the connection if there is none yet.
};

/// A body as the operator sees it; disabled ones are not in any frame.
struct ControlledBody {
  int id{};
  std::string name;
  bool enabled{};
  std::array<double, 3>
      pivot_position_m{};  ///< Of X_BP: place of the pivot P in the body's axes B (the IMU).
  std::array<double, 4> pivot_orientation_wxyz{1, 0, 0, 0};
};

enum class RecordingState {
  kStarting,  ///< Samples are taken; the disk has not opened the files yet.
  kRecording,
  kStopping,  ///< Nothing more is taken; what was taken is still being written.
  kFinished,  ///< Everything is on disk.
  kFailed,    ///< Over, too: see `reason`.
};

/// How a recording goes, or how it went.
struct Recording {
  std::string name;
  RecordingState state{};
  std::string reason;       ///< Why it failed; else empty.
  std::uint64_t samples{};  ///< On disk: IMU readings, and images or their corners.
  std::uint64_t bytes{};    ///< On disk.
  std::uint64_t dropped{};  ///< Not recorded, because the disk was slow or failed.
};

/// Where the middle of a tag is in the room, as somebody has measured it.
struct MeasuredTag {
  int tag_id{};
  std::array<double, 3> position_m{};  ///< Axes of the room: right-handed, z up.
};

struct ControlState {
  std::vector<ControlledBody> bodies;
  bool mapping{};         ///< The map grows and is refined; false: it stands still.
  std::string recording;  ///< Name of the recording under way; empty: none.
  /// Those that are not over, and up to eight that are; the newest last.
  std::vector<Recording> recordings;
  std::int64_t map_version{};  ///< Of the map that is served, as it was stored last; 0: never.
};

/// Whether a command was carried out, and if not, why, in one sentence for a person.
struct Outcome {
  bool done{};
  std::string problem;
  explicit operator bool() const { return done; }
};

/// Commands by one connection, made when first needed and again after it broke. Every call waits
/// for the answer, at most the timeout. A command whose answer did not come may have been carried
/// out. Not thread-safe.
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
  /// Writes the map as it is now as a version. Answered before the disk is, as the two below:
  /// events of the subject `map` (events.hpp) say how it went.
  /// @param name  that the history shall show; empty: none
  Outcome commit_map(const std::string& name = {});
  Outcome name_version(std::int64_t version, const std::string& name);
  /// Serves a stored version again, as a new version. Refused while the map is frozen.
  Outcome roll_back(std::int64_t version);
  /// Says where the workspace lies in the room. From then on poses and tags are streamed in the
  /// room's axes: they jump there once.
  /// @param measured  three tags or more
  Outcome align_map(const std::vector<MeasuredTag>& measured);
  /// The tag stays in the map and is not used.
  Outcome quarantine_tag(int tag_id);
  /// Nothing is known of the tag any more: seen again, it is a new one. Refused while the map is
  /// frozen.
  Outcome forget_tag(int tag_id);
  /// Answered before the disk is: `list` says whether it records.
  /// @param name  of the folder; empty: the date and time
  Outcome start_recording(const std::string& name = {});
  /// Answered while what was taken is still being written: `list` says when that is done, and how.
  Outcome stop_recording();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
