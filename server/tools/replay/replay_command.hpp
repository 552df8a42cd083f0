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
  std::string filter;  ///< Empty: the default of OfflineSetup.
  std::vector<std::string> sets;
  bool together{false};  ///< Several robots over one live map.
  bool anyway{false};    ///< Also what the check calls unusable.
  bool json{false};
};

/// What a replay of `info` with these arguments is to do: the recording's own sizes and tags, over
/// them what --config and --set really say, and the tags of --map as inputs.
[[nodiscard]] Expected<OfflineSetup> replay_setup(const ReplayArguments& arguments,
                                                  const RecordingInfo& info);

/// `fiducap replay`. @return exit code
[[nodiscard]] int run_replay(const ReplayArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
