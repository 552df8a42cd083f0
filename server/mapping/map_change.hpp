#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "mapping/map_alignment.hpp"

namespace fiducap {

/// Writes the map as it is as a version. Empty: without a name.
struct CommitVersion {
  std::string name;
};
/// A stored version that has a name (its comment) is never thinned out.
struct NameVersion {
  std::int64_t version{};
  std::string name;
};
/// Serves a stored version again, as a new version.
struct RollBack {
  std::int64_t version{};
};
/// Says where the workspace lies in the room, by tags that were measured there.
struct AlignMap {
  std::vector<MeasuredPlace> places;
};
/// See MapBuilder::quarantine and forget.
struct QuarantineTag {
  int tag_id{};
};
struct ForgetTag {
  int tag_id{};
};

/// What an operator does to the map by hand, live.
using MapChange =
    std::variant<CommitVersion, NameVersion, RollBack, AlignMap, QuarantineTag, ForgetTag>;
/// Those that need the store.
using StoreChange = std::variant<CommitVersion, NameVersion, RollBack>;

}  // namespace fiducap
