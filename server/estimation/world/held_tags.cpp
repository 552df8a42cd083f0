#include "estimation/world/held_tags.hpp"

#include <algorithm>
#include <utility>

#include "base/so3.hpp"
#include "estimation/world/map_exchange.hpp"
#include "estimation/world/tag_entry.hpp"

namespace fiducap::world {

namespace {

// Map tags are held while in view, and so many more of those seen last: what their errors share
// with the body's is worth keeping for a while, and a hall of a thousand tags costs what a room of
// ten does.
constexpr std::size_t kHeldOutOfView = 12;
// The map has another place for a tag that moved more than this, or whose variance changed by this
// share.
constexpr double kSamePlace = 1e-9;
constexpr double kSameVariance = 0.01;

bool is_in_view(const TagObservations& seen, int tag_id) {
  return std::any_of(seen.tags.begin(), seen.tags.end(),
                     [&](const auto& s) { return s.tag_id == tag_id; });
}

bool is_news(const FilterState& state, std::size_t i, const KnownTag& now) {
  const Pose& X_WT = state.tags[i].X_WT;
  if ((X_WT.p - now.X_WT.p).norm() > kSamePlace || angle_between(X_WT.q, now.X_WT.q) > kSamePlace)
    return true;
  const Matrix6d held = tag_in_workspace(state, i).covariance;
  return (held - now.covariance).norm() > kSameVariance * held.norm();
}

/// What the map says of the tags that are held.
void follow_map(FilterState& state, const TagObservations& seen, std::span<const KnownTag> known) {
  for (std::size_t i = state.tags.size(); i-- > 0;) {
    const WorldTag& tag = state.tags[i];
    if (!tag.held) continue;
    const auto now = std::find_if(known.begin(), known.end(),
                                  [&](const KnownTag& k) { return k.tag_id == tag.tag_id; });
    if (now == known.end()) {
      if (is_in_view(seen, tag.tag_id)) state.remove_tag(i);  // the map does not stand by it
    } else if (is_news(state, i, *now)) {
      const bool is_moved = !replace_held(state, i, *now);
      if (is_moved || now->is_exact()) state.remove_tag(i);
    }
  }
}

/// Held tags that the map does not stand by any more.
void forget_unknown(FilterState& state, const KnownMap& map) {
  for (std::size_t i = state.tags.size(); i-- > 0;) {
    if (state.tags[i].held && map.find(state.tags[i].tag_id) == nullptr) state.remove_tag(i);
  }
}

}  // namespace

std::optional<Pose> HeldTags::take_over(FilterState& state, const KnownMap& map, bool level) {
  if (!has_news(map)) return std::nullopt;
  revision_ = map.revision;
  return exchange(state, map, level);
}

void HeldTags::follow(FilterState& state, const TagObservations& seen,
                      std::span<const KnownTag> known, const KnownMap* whole, bool is_anchored) {
  if (whole == nullptr) follow_map(state, seen, known);
  if (whole != nullptr) forget_unknown(state, *whole);
  if (is_anchored) {
    for (const KnownTag& tag : known) {
      if (is_in_view(seen, tag.tag_id)) hold_one(state, tag, whole, seen.exposed_at);
    }
  }
  forget(state, seen);
}

/// Of those out of view the ones seen last stay.
void HeldTags::forget(FilterState& state, const TagObservations& seen) {
  out_of_view_.clear();
  for (std::size_t i = 0; i < state.tags.size(); ++i) {
    if (state.tags[i].held && !is_in_view(seen, state.tags[i].tag_id)) out_of_view_.push_back(i);
  }
  if (out_of_view_.size() <= kHeldOutOfView) return;
  const auto is_older = [&](std::size_t a, std::size_t b) {
    return std::pair(state.tags[a].last_seen, a) < std::pair(state.tags[b].last_seen, b);
  };
  std::sort(out_of_view_.begin(), out_of_view_.end(), is_older);
  out_of_view_.resize(out_of_view_.size() - kHeldOutOfView);
  std::sort(out_of_view_.begin(), out_of_view_.end());
  state.remove_tags(out_of_view_);
}

void hold_one(FilterState& state, const KnownTag& tag, const KnownMap* whole, Instant at) {
  if (tag.is_exact() || state.find(tag.tag_id) >= 0) return;
  whole != nullptr ? hold_beside(state, tag, *whole, at) : hold(state, tag, at);
}

}  // namespace fiducap::world
