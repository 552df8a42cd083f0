#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "daemon/config/config_file.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/replay/map_turns.hpp"

namespace fiducap {

/// What the live server wrote around the recordings of one session (SessionRecorder).
struct SessionFolder {
  std::string folder;
  ServerConfig config;
  TagMap map;                  ///< As it was when the recording began.
  std::vector<MapTurn> turns;  ///< Bodies by their place in the configuration.
  /// When the map was refined; nullopt: it was not, or that was not recorded yet.
  std::optional<std::vector<RefinementTurn>> refinements;
  std::vector<std::string> bodies;  ///< Folders of the recordings, in that order.
};

/// Whether a server's session was recorded here.
[[nodiscard]] bool is_session(const std::string& folder);
/// @param sets  over the session's own configuration, as in load_config
[[nodiscard]] Expected<SessionFolder> read_session(const std::string& folder,
                                                   const std::vector<std::string>& sets = {});
/// The session that a recording belongs to; nullopt: it stands alone.
[[nodiscard]] std::optional<std::string> session_of(const std::string& recording);

}  // namespace fiducap
