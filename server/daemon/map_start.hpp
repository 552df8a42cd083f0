#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "daemon/config/config_file.hpp"
#include "estimation/body_filter.hpp"
#include "mapping/store/map_store.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// What the server knows about the room when it starts.
struct StartMap {
  TagMap map;
  std::optional<MapStore> store;          ///< nullopt: the map is forgotten at the end.
  std::vector<StoredExtrinsics> learned;  ///< Of earlier sessions.
};

/// Opens the store and takes its newest sound map; an empty store (or none) starts from `map.file`,
/// which is committed then. A damaged file is repaired and kept aside, damaged versions are passed
/// over and kept; both are told (`rolled_back`).
/// @return Error naming the file: nothing in it is sound, of another tag family, not writable
[[nodiscard]] Expected<StartMap> open_start_map(const MapSettings& settings,
                                                const TagSetConfig& tags, EventBoard& events);

/// Puts what was learned about the body's cameras in place of the configured X_BV, where it does
/// not contradict the configuration: a camera that has been moved and measured again starts from
/// the new measurement.
void use_learned(const std::vector<StoredExtrinsics>& learned, const std::string& body,
                 BodySensors& sensors);

/// What was found wrong about lenses is doubted from the start (KnownMap::wrong_lenses): it is
/// found again, and said again, within seconds, also where the map is frozen. Nothing where the map
/// does not say how its tags hang together.
/// @param body_ids  by name
void doubt_learned_lenses(const std::vector<StoredExtrinsics>& learned,
                          const std::map<std::string, int>& body_ids, TagMap& map);

}  // namespace fiducap
