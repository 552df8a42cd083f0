#include "mapping/tag_map.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace fiducap {

namespace {

constexpr std::array<TagState, 4> kTagStates{TagState::kLocal, TagState::kCalibrated,
                                             TagState::kSurveyed, TagState::kQuarantined};

}  // namespace

std::string_view name_of(TagState state) {
  switch (state) {
    case TagState::kLocal:
      return "local";
    case TagState::kCalibrated:
      return "calibrated";
    case TagState::kSurveyed:
      return "surveyed";
    case TagState::kQuarantined:
      return "quarantined";
  }
  return "local";
}

std::optional<TagState> tag_state_from(std::string_view name) {
  for (const TagState state : kTagStates) {
    if (name_of(state) == name) return state;
  }
  return std::nullopt;
}

const MapTag* TagMap::find(int tag_id) const {
  const auto found =
      std::lower_bound(tags.begin(), tags.end(), tag_id,
                       [](const MapTag& entry, int id) { return entry.tag.tag_id < id; });
  return found != tags.end() && found->tag.tag_id == tag_id ? &*found : nullptr;
}

MapTag* TagMap::find(int tag_id) {
  const MapTag* found = std::as_const(*this).find(tag_id);
  return found == nullptr ? nullptr : &tags[static_cast<std::size_t>(found - tags.data())];
}

void TagMap::known_among(const TagObservations& seen, std::vector<KnownTag>& out) const {
  out.clear();
  for (const TagObservation& observation : seen.tags) {
    const MapTag* entry = find(observation.tag_id);
    if (entry == nullptr || entry->component != 0 || entry->state == TagState::kQuarantined)
      continue;
    out.push_back(entry->tag);
  }
}

}  // namespace fiducap
