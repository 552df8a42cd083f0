#pragma once

#include <string>
#include <vector>

#include "mapping/formats/foreign_map.hpp"

namespace fiducap {

/// Settles `imported.map.family`, which is what the file says or empty: the options decide where it
/// says nothing, and where they do not either it is tag36h11, with a remark.
/// @return Error when options and file contradict each other
[[nodiscard]] Expected<void> settle_family(ImportedMap& imported, const MapImportOptions& options,
                                           const std::string& context);

/// Stands in the workspace, and nothing contradicts it.
[[nodiscard]] inline bool is_trusted(const MapTag& entry) {
  return entry.state != TagState::kQuarantined && entry.component == 0;
}

/// What a format of another program can say beside ids and poses.
struct Keeps {
  bool sizes{true};
  bool sigmas{false};
  bool alignment{false};  ///< Of the workspace to the room.
};

/// The tags that a map trusts and that stand in its workspace. Remarked: the others, and what the
/// format loses of these.
[[nodiscard]] std::vector<const MapTag*> tags_to_export(const TagMap& map, Keeps keeps,
                                                        std::vector<std::string>& remarks);

}  // namespace fiducap
