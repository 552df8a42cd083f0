// MapBuilder without a graph: the belief of the body that knows a tag best is copied.
#include <cmath>

#include "base/pose.hpp"
#include "base/text.hpp"
#include "mapping/map_builder.hpp"

namespace fiducap {

namespace {

// Ratio of variances below which another belief replaces an owner's: two equally good bodies do not
// take turns.
constexpr double kBetterBy = 0.7;
constexpr double kVisible_m = 1e-4;
constexpr double kVisible_rad = 0.01 * M_PI / 180.0;
constexpr double kVisibleSigma = 0.1;
// A tag has settled when it was observed this long without a visible change.
constexpr Duration kStillToSettle = std::chrono::seconds(10);
// Smaller differences are errors of the map or the body, not a moved tag.
constexpr double kMove_m = 0.1;
constexpr double kMove_rad = 0.1;
// A tag that was found in place may be quarantined again after this time.
constexpr Duration kRecheckAfter = std::chrono::minutes(1);

double position_variance(const KnownTag& tag) { return tag.covariance.diagonal().head<3>().sum(); }

bool differs_visibly(const KnownTag& now, const KnownTag& published) {
  const double before = std::sqrt(position_variance(published));
  return (now.X_WT.p - published.X_WT.p).norm() > kVisible_m ||
         angle_between(now.X_WT.q, published.X_WT.q) > kVisible_rad ||
         std::abs(std::sqrt(position_variance(now)) - before) > kVisibleSigma * before;
}

/// Variances of exact numbers (the reference tag's place) may be rounded below zero.
TagBelief without_rounding(TagBelief belief) {
  constexpr double kRounding = 1e-9;
  for (int i = 0; i < 6; ++i) {
    double& variance = belief.tag.covariance(i, i);
    if (variance < 0 && variance > -kRounding) variance = 0;
  }
  return belief;
}

}  // namespace

MapBuilder::Owners MapBuilder::owners_in(const TagMap& start) {
  Owners owners;
  for (const MapTag& entry : start.tags) {
    if (entry.state == TagState::kLocal) owners[entry.tag.tag_id] = {};
    if (entry.state == TagState::kQuarantined)
      owners[entry.tag.tag_id] = {.quarantined_at = Instant::min()};
  }
  return owners;
}

bool MapBuilder::is_good(const TagBelief& belief) const {
  const auto variances = belief.tag.covariance.diagonal().array();
  if (belief.component != TagBelief::kWorkspace) return false;
  if (belief.sightings < config_.publish_sightings || fault_in(MapTag{.tag = belief.tag}))
    return false;
  const double position = config_.publish_position_sigma_m;
  const double rotation = config_.publish_rotation_sigma_rad;
  return variances.head<3>().maxCoeff() <= position * position &&
         variances.tail<3>().maxCoeff() <= rotation * rotation;
}

bool MapBuilder::quarantine_locked(const MapContribution& contribution, int tag_id) {
  MapTag* entry = working_.find(tag_id);
  if (entry == nullptr || !entry->is_usable()) return false;
  if (entry->state == TagState::kSurveyed) {
    note_contradicted_once_locked(contribution.body_id, tag_id, "it was surveyed");
    return false;
  }
  Owner& owner = owners_[tag_id];
  const auto kept_at = owner.kept_at;
  if (kept_at && contribution.at - *kept_at < kRecheckAfter) return false;
  owner = {.quarantined_at = contribution.at, .before = entry->state, .kept_at = kept_at};
  entry->state = TagState::kQuarantined;
  if (!kept_at)
    note_locked(MapEvent::Kind::kTagQuarantined, tag_id,
                "tag " + std::to_string(tag_id) + " is not where the map has it, as seen by body " +
                    std::to_string(contribution.body_id) +
                    "; it is not used until its new place is known");
  return true;
}

/// The first belief since the quarantine. @return false when the tag has not moved
bool MapBuilder::find_moved_locked(int body_id, const TagBelief& belief, MapTag& entry,
                                   Owner& owner) {
  const int id = belief.tag.tag_id;
  const double moved_m = (belief.tag.X_WT.p - entry.tag.X_WT.p).norm();
  if (moved_m < kMove_m && angle_between(belief.tag.X_WT.q, entry.tag.X_WT.q) < kMove_rad) {
    // Map and body differ by more than their covariances. Adopting one tag after the other would
    // bend the map towards this body.
    if (!owner.kept_at)
      note_locked(MapEvent::Kind::kTagDisputed, id,
                  "tag " + std::to_string(id) + " is " + fixed(moved_m, 3) +
                      " m from its place as seen by body " + std::to_string(body_id) +
                      ", too little for a move; its place is kept");
    entry.state = owner.before;
    owner = {.kept_at = belief.last_seen};
    return false;
  }
  note_locked(MapEvent::Kind::kTagMoved, id,
              "tag " + std::to_string(id) + " has a new place, " + fixed(moved_m, 3) +
                  " m from the old one");
  entry.state = TagState::kLocal;
  owner = {.body_id = body_id};
  return true;
}

/// Whether this belief improves on the map.
bool MapBuilder::accept_locked(int body_id, const TagBelief& belief, const MapTag& entry,
                               Owner& owner) {
  // Sightings before it moved are of the old place.
  if (owner.quarantined_at) return belief.last_seen > *owner.quarantined_at;
  if (owner.kept_at) return false;
  const double offered = position_variance(belief.tag);
  const double known = position_variance(entry.tag);
  if (owner.body_id == body_id) return kBetterBy * offered <= known;
  if (offered >= kBetterBy * known) return false;
  note_locked(MapEvent::Kind::kTagRefined, belief.tag.tag_id,
              "tag " + std::to_string(belief.tag.tag_id) + " is known better by body " +
                  std::to_string(body_id));
  return true;
}

bool MapBuilder::absorb_locked(int body_id, const TagBelief& offered, std::int64_t utc_now_ns) {
  const TagBelief belief = without_rounding(offered);
  const int id = belief.tag.tag_id;
  if (!is_good(belief) || pending_.is_outdated(body_id, id)) return false;
  MapTag* entry = working_.find(id);
  const bool is_new = entry == nullptr;
  if (is_new) {
    owners_[id] = {.body_id = body_id};
    entry = &insert_locked(belief.tag, ", seen by body " + std::to_string(body_id));
    entry->first_seen_utc_ns = utc_now_ns - (belief.last_seen - belief.first_seen).count();
  }
  const auto owned = owners_.find(id);
  if (owned == owners_.end()) return false;  // a fixed tag of the starting map
  Owner& owner = owned->second;
  if (!is_new && !accept_locked(body_id, belief, *entry, owner)) return false;
  has_workspace_ = true;
  if (owner.quarantined_at && !find_moved_locked(body_id, belief, *entry, owner)) return true;
  if (owner.body_id != body_id) owner = {.body_id = body_id};
  entry->tag = belief.tag;
  entry->sightings = belief.sightings;
  if (belief.last_seen > owner.last_seen) entry->last_seen_utc_ns = utc_now_ns;
  owner.last_seen = belief.last_seen;
  const MapTag* published = snapshot_->find(id);
  const bool moved = published == nullptr || published->state != entry->state ||
                     differs_visibly(entry->tag, published->tag);
  return settle_locked(*entry, owner, moved) || moved;
}

/// A tag that is seen, and whose published place does not change any more, has settled.
bool MapBuilder::settle_locked(MapTag& entry, Owner& owner, bool moved) {
  if (moved || !owner.still_since) owner.still_since = owner.last_seen;
  if (entry.state != TagState::kLocal || entry.sightings < kSightingsToSettle ||
      owner.last_seen - *owner.still_since < kStillToSettle)
    return false;
  entry.state = TagState::kCalibrated;
  note_locked(MapEvent::Kind::kTagCalibrated, entry.tag.tag_id,
              "tag " + std::to_string(entry.tag.tag_id) + " has settled");
  return true;
}

}  // namespace fiducap
