#pragma once

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

/// `fiducap replay`. @return exit code
[[nodiscard]] int run_replay(const ReplayArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
