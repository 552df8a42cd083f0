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

/// The map at the start of the server.
struct StartMap {
  TagMap map;
  std::optional<MapStore> store;          ///< nullopt: the map is not stored.
  std::vector<StoredExtrinsics> learned;  ///< Of earlier sessions.
};

/// Opens the store and loads its newest valid map; an empty store (or none) starts from `map.file`,
/// which is committed then. A damaged file is repaired and kept aside, damaged versions are skipped
/// and kept; both are reported (`rolled_back`).
/// @return Error naming the file: nothing in it is valid, of another tag family, not writable
[[nodiscard]] Expected<StartMap> open_start_map(const MapSettings& settings,
                                                const TagSetConfig& tags, EventBoard& events);

/// Replaces the configured X_BV of the body's cameras by stored estimates that do not contradict
/// it: a camera that was moved and measured again starts from the new measurement.
void use_learned(const std::vector<StoredExtrinsics>& learned, const std::string& body,
                 BodySensors& sensors);

/// Marks stored lens errors as doubtful from the start (KnownMap::wrong_lenses), so that they are
/// found and reported again within seconds, also with a frozen map. No effect without a KnownMap.
/// @param body_ids  by name
void doubt_learned_lenses(const std::vector<StoredExtrinsics>& learned,
                          const std::map<std::string, int>& body_ids, TagMap& map);

}  // namespace fiducap
