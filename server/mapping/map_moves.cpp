// What a map with a graph makes of tags that are not in their places: a part of MapBuilder.
#include <algorithm>
#include <utility>

#include "mapping/map_builder.hpp"
#include "mapping/map_edit.hpp"

namespace fiducap {

/// @return true when the published map should follow
bool MapBuilder::watch_locked(const MapContribution& contribution, std::int64_t utc_now_ns) {
  if (!contribution.anchored) return false;
  std::vector<int> contradicted;
  for (const int tag_id : contribution.contradicted) {
    const MapTag* entry = working_.find(tag_id);
    if (entry != nullptr && entry->component == 0) contradicted.push_back(tag_id);
  }
  bool follow = false;
  for (const TagSuspicion& suspicion :
       watch_.hear(contribution.body_id, contribution.at, contribution.fitting, contradicted))
    follow |= suspect_locked(suspicion, utc_now_ns);
  return follow;
}

bool MapBuilder::suspect_locked(const TagSuspicion& suspicion, std::int64_t utc_now_ns) {
  const int tag_id = suspicion.tag_id;
  MapTag& entry = *working_.find(tag_id);
  const bool is_frozen = config_.mode == MapMode::kFrozen;
  if (is_frozen || entry.state == TagState::kSurveyed) {
    note_contradicted_once_locked(*suspicion.by.begin(), tag_id,
                                  is_frozen ? "the map is frozen" : "the survey holds");
    return false;
  }
  const auto event = moved_.suspect(suspicion, entry, utc_now_ns);
  if (!event) return false;
  note_locked(event->kind, tag_id, event->text);
  watch_.forget(tag_id);
  entry.state = TagState::kQuarantined;
  leave_out_locked(tag_id);
  return true;
}

/// No filter leans on the tag any more.
void MapBuilder::leave_out_locked(int tag_id) {
  if (working_.known == nullptr) return;
  drop_ties(working_, tag_id);
  replace_known_locked(*working_.known);
}

/// @return whether filters may lean on it, at its place of now
bool MapBuilder::find_again_locked(const GraphTagEstimate& found,
                                   std::span<const GraphTagEstimate> all, MapTag& entry) {
  if (moved_.is_away(found.tag_id)) {
    const auto verdict = moved_.judge(found, all, entry);
    if (!verdict) return false;
    note_locked(verdict->event.kind, found.tag_id, verdict->event.text);
    entry.state = verdict->state;
  } else {
    entry.state = TagState::kLocal;  // of another session: this one has found it
  }
  return true;
}

MapBuilder::Waiting MapBuilder::take_segments() {
  const std::lock_guard lock(mutex_);
  return {std::exchange(segments_, {}), std::exchange(begin_anew_, nullptr), moved_.take_orders(),
          contributions_};
}

}  // namespace fiducap
