#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct ReplayArguments {
  std::vector<std::string> recordings;
  std::string out;
  std::string config;
  std::string map;
  std::string store;   ///< Of a map: its newest version is where the map begins.
  std::string filter;  ///< Empty: the default of OfflineSetup.
  std::vector<std::string> sets;
  bool together{false};  ///< Several robots over one live map.
  bool resolve{false};   ///< Everything is solved for together after the last image.
  bool anyway{false};    ///< Also what the check calls unusable.
  bool plots{true};      ///< Also write plots.html.
  bool json{false};
};

/// What a replay of `info` with these arguments is to do: the recording's own sizes and tags, over
/// them what --config and --set really say, and the tags of --map as inputs.
[[nodiscard]] Expected<OfflineSetup> replay_setup(const ReplayArguments& arguments,
                                                  const RecordingInfo& info);

/// Whether the user says anything about `section.key`: what nobody mentions stays as the recording,
/// or the verb, has it. @pre the file can be read
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

/// Says what is wrong with the recordings, and how long they are. What is recorded of a session is
/// repeated as it was, good or bad.
/// @return Error when one cannot be used
[[nodiscard]] Expected<void> check_replay_inputs(const ReplayArguments& arguments,
                                                 ReplayInputs& inputs, const Terminal& terminal);

}  // namespace fiducap
