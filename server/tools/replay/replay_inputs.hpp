#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "daemon/config/config_file.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/replay/map_turns.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "tools/replay/replay_verbs.hpp"

namespace fiducap {

/// Setup for a replay of `info`: the recording's own sizes and tags, over them the keys that
/// --config and --set contain, and the tags of --map as inputs.
[[nodiscard]] Expected<OfflineSetup> replay_setup(const ReplayArguments& arguments,
                                                  const RecordingInfo& info);

/// Whether the file or `sets` contain `section.key`; the recording or the verb has the values of
/// keys that they do not contain. @pre the file can be read
[[nodiscard]] bool is_mentioned(const std::string& file, const std::vector<std::string>& sets,
                                const std::string& section, const std::string& key);

/// One robot of a replay.
struct ReplayInput {
  RecordingInfo info;
  OfflineSetup setup;
  std::unique_ptr<SensorSource> source;
  double length_s{0};  ///< Of its data; 0: not known.
};

/// All robots of a replay and what they share.
struct ReplayInputs {
  std::vector<ReplayInput> bodies;
  OfflineMap map;
  bool is_session{false};
};

/// Opens the recordings, or the session, that the arguments name.
[[nodiscard]] Expected<ReplayInputs> read_replay_inputs(const ReplayArguments& arguments);

/// Reports the faults of the recordings and sets their lengths. Recordings of a session are
/// replayed with their faults.
/// @return Error when one cannot be used
[[nodiscard]] Expected<void> check_replay_inputs(const ReplayArguments& arguments,
                                                 ReplayInputs& inputs, const Terminal& terminal);

/// What the live server wrote around the recordings of one session (SessionRecorder).
struct SessionFolder {
  std::string folder;
  ServerConfig config;
  TagMap map;                  ///< At the start of the recording.
  std::vector<MapTurn> turns;  ///< Bodies by their place in the configuration.
  /// When the map was refined; nullopt: never, or that was not recorded.
  std::optional<std::vector<RefinementTurn>> refinements;
  std::vector<std::string> bodies;  ///< Folders of the recordings, in that order.
};

/// Whether the folder holds a server's session.
[[nodiscard]] bool is_session(const std::string& folder);
/// @param sets  over the session's own configuration, as in load_config
[[nodiscard]] Expected<SessionFolder> read_session(const std::string& folder,
                                                   const std::vector<std::string>& sets = {});
/// The session that a recording belongs to; nullopt: none.
[[nodiscard]] std::optional<std::string> session_of(const std::string& recording);

}  // namespace fiducap
