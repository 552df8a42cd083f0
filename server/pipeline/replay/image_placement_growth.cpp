#include <algorithm>
#include <utility>

#include "pipeline/replay/image_placement.hpp"

namespace fiducap {

/// @return whether one is elsewhere than before
bool ImagePlacement::place_instants(bool all) {
  bool changed = false;
  for (std::size_t b = 0; b < placed_.size(); ++b) {
    for (std::size_t i = 0; i < placed_[b].size(); ++i) {
      if (!all && !waits_[b][i]) continue;
      waits_[b][i] = false;
      changed |= place_instant(b, i);
    }
  }
  return changed;
}

/// Instants beside one that has a place get theirs by odometry, and the tags that they see by them,
/// in the order of time: a tag is placed by its first visit, and later ones are placed by the tag.
/// @return whether anything has got a place
bool ImagePlacement::follow_odometry(std::size_t body) {
  if (bodies_[body].odometry == nullptr) return false;
  const auto count = placed_[body].size();
  bool changed = false;
  for (std::size_t i = 1; i < count; ++i) changed |= carry(body, i - 1, i);
  for (std::size_t i = count; i-- > 1;) changed |= carry(body, i, i - 1);
  return changed;
}

/// @return whether `to` has got a place
bool ImagePlacement::carry(std::size_t body, std::size_t from, std::size_t to) {
  const Placed& before = placed_[body][from];
  Placed& now = placed_[body][to];
  if (now.region != kNowhere || before.region == kNowhere) return false;
  const auto moved = bodies_[body].odometry->motion(before.at, now.at);
  if (!moved) return false;
  now.region = before.region;
  now.X_WB = before.X_WB * *moved;
  now.is_sure = true;
  place_instant(body, to);
  for (const TagObservations& image : seen_[body][to])
    for (const TagObservation& seen : image.tags)
      if (!tags_.contains(seen.tag_id)) place_tag(seen.tag_id);
  return true;
}

bool ImagePlacement::grow() {
  constexpr int kMostTurns = 100;
  bool changed = false;
  for (int turn = 0; turn < kMostTurns; ++turn) {
    const bool moved = place_instants(false);
    bool is_new = false;
    for (std::size_t b = 0; b < bodies_.size(); ++b) is_new |= follow_odometry(b);
    for (const auto& [tag_id, seen] : sightings_)
      if (!tags_.contains(tag_id)) is_new |= place_tag(tag_id);
    changed |= moved || is_new;
    if (!is_new) break;
  }
  return changed;
}

bool ImagePlacement::settle() {
  bool changed = place_instants(true);
  for (const auto& [tag_id, tag] : std::map(tags_)) changed |= place_tag(tag_id);
  do changed |= grow();
  while (begin_elsewhere() || begin_with_two() || begin_with_one() || join_regions());
  return changed;
}

}  // namespace fiducap
