#include "pipeline/contradicted_tags.hpp"

#include <algorithm>
#include <utility>

#include "mapping/map_edit.hpp"
#include "mapping/moved_tags.hpp"

namespace fiducap {

namespace {
// A filter rejects a tag after ten images.
constexpr int kSightingsToReport = 10;
}  // namespace

const KnownMap* ContradictedTags::use(const TagMap& map, std::vector<KnownTag>& known) {
  if (!tags_.empty()) forget_changed(map);
  if (map.known == nullptr || (tags_.empty() && returned_ == 0)) return map.known.get();
  const auto is_out = [&](int tag_id) { return tags_.contains(tag_id); };
  std::erase_if(known, [&](const KnownTag& tag) { return is_out(tag.tag_id); });
  if (rest_ == nullptr || base_ != map.known) {
    KnownMap rest = without_tags(*map.known, is_out);
    rest.revision += returned_ << 32;
    base_ = map.known;
    rest_ = std::make_shared<const KnownMap>(std::move(rest));
  }
  return rest_.get();
}

/// The map has other places for them, or does not use them.
void ContradictedTags::forget_changed(const TagMap& map) {
  const auto erased = std::erase_if(tags_, [&](const auto& entry) {
    const MapTag* now = map.find(entry.first);
    return now == nullptr || !now->is_usable() || !is_near(now->tag.X_WT, entry.second.in_map.X_WT);
  });
  if (erased > 0) rest_.reset();
}

void ContradictedTags::add(const TagMap& map, int tag_id) {
  const MapTag* entry = map.find(tag_id);
  if (entry == nullptr || !entry->is_usable()) return;
  tags_[tag_id] = {entry->tag};
  rest_.reset();
}

void ContradictedTags::forget_all() {
  if (tags_.empty()) return;
  tags_.clear();
  ++returned_;
  rest_.reset();
}

void ContradictedTags::compare(std::span<const TagBelief> beliefs, std::vector<int>& out) {
  for (auto at = tags_.begin(); at != tags_.end();) {
    const auto next = std::next(at);
    auto& [tag_id, tag] = *at;
    const auto own = std::ranges::find(beliefs, tag_id,
                                       [](const TagBelief& belief) { return belief.tag.tag_id; });
    if (own == beliefs.end()) {
      tag.reported = 0;
    } else if (!is_same_place(own->tag, tag.in_map)) {
      if (own->sightings - tag.reported >= kSightingsToReport) {
        tag.reported = own->sightings;
        out.push_back(tag_id);
      }
    } else if (is_confirmed(own->sightings, own->last_seen - own->first_seen)) {
      tags_.erase(at);
      ++returned_;
      rest_.reset();
    }
    at = next;
  }
}

std::shared_ptr<const MotionSegment> ContradictedTags::without(
    std::shared_ptr<const MotionSegment> segment) const {
  if (segment == nullptr || tags_.empty()) return segment;
  const auto is_out = [&](int tag_id) { return tags_.contains(tag_id); };
  if (std::ranges::none_of(segment->tags, [&](const KnownTag& tag) { return is_out(tag.tag_id); }))
    return segment;
  MotionSegment rest = *segment;
  remove_sightings(rest, [&](const auto&, const auto&, const SegmentSighting& one) {
    return is_out(one.seen.tag_id);
  });
  return std::make_shared<const MotionSegment>(std::move(rest));
}

}  // namespace fiducap
