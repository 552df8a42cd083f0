#include "mapping/map_builder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/so3.hpp"
#include "base/text.hpp"

namespace fiducap {

namespace {

// The variance another belief must fall below to replace an owner's: keeps two equally good bodies
// from taking turns.
constexpr double kBetterBy = 0.7;
constexpr double kMoved_m = 1e-4;
constexpr double kTurned_rad = 0.01 * M_PI / 180.0;
constexpr double kSigmaChanged = 0.1;
// A tag has settled when it was looked at for so long without a visible change.
constexpr Duration kStillToSettle = std::chrono::seconds(10);
constexpr int kSightingsToSettle = 100;
// Less than this is not a tag that somebody moved.
constexpr double kMove_m = 0.1;
constexpr double kMove_rad = 0.1;
// Long enough not to be asked the same again and again, short enough for a tag that then moves.
constexpr Duration kDisputeHolds = std::chrono::minutes(1);
constexpr std::size_t kKeptEvents = 256;
constexpr std::size_t kKeptSegments = 1024;

double position_variance(const KnownTag& tag) { return tag.covariance.diagonal().head<3>().sum(); }

bool differs_visibly(const KnownTag& now, const KnownTag& published) {
  const double before = std::sqrt(position_variance(published));
  return (now.X_WT.p - published.X_WT.p).norm() > kMoved_m ||
         angle_between(now.X_WT.q, published.X_WT.q) > kTurned_rad ||
         std::abs(std::sqrt(position_variance(now)) - before) > kSigmaChanged * before;
}

bool same_content(const TagMap& a, const TagMap& b) {
  return a.X_RW.p == b.X_RW.p && a.X_RW.q.coeffs() == b.X_RW.q.coeffs() &&
         std::equal(a.tags.begin(), a.tags.end(), b.tags.begin(), b.tags.end(),
                    [](const MapTag& x, const MapTag& y) {
                      return x.tag.tag_id == y.tag.tag_id && x.tag.X_WT.p == y.tag.X_WT.p &&
                             x.tag.X_WT.q.coeffs() == y.tag.X_WT.q.coeffs() &&
                             x.tag.covariance == y.tag.covariance && x.state == y.state;
                    });
}

/// Numbers that are known exactly, as the place of the reference tag is, may come with a variance a
/// hair below zero.
TagBelief without_rounding(TagBelief belief) {
  constexpr double kRounding = 1e-9;
  for (int i = 0; i < 6; ++i) {
    double& variance = belief.tag.covariance(i, i);
    if (variance < 0 && variance > -kRounding) variance = 0;
  }
  return belief;
}

/// What filters are to have open as well.
void note_wrong(std::span<const GraphFinding> findings, KnownMap& known) {
  using Kind = FoundMismatch::Kind;
  for (const auto& [body_id, what] : findings) {
    if (what.kind == Kind::kAllPrints) known.wrong_prints.push_back(KnownMap::kAllPrints);
    if (what.kind == Kind::kOnePrint) known.wrong_prints.push_back(what.tag_id);
    if (what.camera >= 0 && what.kind != Kind::kReadout)
      known.wrong_lenses.push_back({body_id, what.camera, what.kind});
  }
}

}  // namespace

std::vector<ConfigError> MapConfig::check() const {
  return Checker{"map."}
      .positive("publish_position_sigma_m", publish_position_sigma_m)
      .positive("publish_rotation_sigma_rad", publish_rotation_sigma_rad)
      .within("publish_sightings", publish_sightings, 1, 1'000'000)
      .not_negative("refine_period_s", refine_period_s)
      .positive("commit_period_s", commit_period_s)
      .errors;
}

MapBuilder::MapBuilder(const MapConfig& config, TagMap start)
    : config_(config),
      snapshot_(std::make_shared<const TagMap>(start)),
      working_(std::move(start)),
      starts_with_places_(has_places(working_)),
      has_workspace_(starts_with_places_) {
  if (working_.known) {
    KnownMap known = *working_.known;
    known.is_judged = false;  // that was of the session before
    working_.known = config.refine_period_s > 0 ? std::make_shared<const KnownMap>(known) : nullptr;
    snapshot_ = std::make_shared<const TagMap>(working_);
  }
  ownership_ = owners_of(working_);
}

bool MapBuilder::ready(const TagBelief& belief) const {
  const auto variances = belief.tag.covariance.diagonal().array();
  if (belief.component != TagBelief::kWorkspace) return false;
  if (belief.sightings < config_.publish_sightings || fault_in(MapTag{.tag = belief.tag}))
    return false;
  const double position = config_.publish_position_sigma_m;
  const double rotation = config_.publish_rotation_sigma_rad;
  return variances.head<3>().maxCoeff() <= position * position &&
         variances.tail<3>().maxCoeff() <= rotation * rotation;
}

/// The reference tag *is* the workspace, for every body alike. Without one it is what the first
/// body makes it, and nobody else may.
bool MapBuilder::may_define_locked(int body_id) const {
  // From its first word on the graph says where W is: by all tags, whoever sees the reference tag.
  if (working_.known != nullptr) return false;
  if (working_.reference_tag)
    return working_.find(*working_.reference_tag) == nullptr && !starts_with_places_;
  return !has_workspace_ && (!founder_ || *founder_ == body_id) &&
         (!defining_ || *defining_ == body_id);
}

MapView MapBuilder::view(int body_id) {
  const std::lock_guard lock(mutex_);
  const bool may_define = may_define_locked(body_id);
  if (may_define && !working_.reference_tag) defining_ = body_id;
  MapView view{snapshot(), may_define, revision_};
  view.body_id = body_id;
  news_.tell(body_id, view);
  return view;
}

void MapBuilder::release(int body_id) {
  const std::lock_guard lock(mutex_);
  if (defining_ == body_id) defining_.reset();
  if (founder_ == body_id && !has_workspace_) founder_.reset();
}

void MapBuilder::note_workspace_locked(const MapContribution& contribution) {
  const bool was_defining = defining_ == contribution.body_id;
  if (was_defining) defining_.reset();
  if (!contribution.anchored || founder_ || working_.reference_tag || has_workspace_) return;
  founder_ = contribution.body_id;
  note_locked(MapEvent::Kind::kWorkspace, 0,
              "body " + std::to_string(contribution.body_id) +
                  " has defined the workspace by its first tag; all other bodies wait for a tag of "
                  "its map (map.reference_tag would let any of them begin)");
}

std::uint64_t MapBuilder::absorb(const MapContribution& contribution, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  note_workspace_locked(contribution);
  const std::uint64_t turn = contributions_++;
  newest_at_ = std::max(newest_at_, contribution.at);
  if (news_.is_behind(contribution.body_id)) return turn;  // it speaks of the map of before
  const bool has_graph = config_.refine_period_s > 0;
  bool follow = has_graph && watch_locked(contribution, utc_now_ns);
  if (config_.mode == MapMode::kFrozen) {
    if (has_graph) return turn;
    for (const int tag_id : contribution.contradicted)
      note_contradicted_once_locked(contribution.body_id, tag_id, "the map is frozen");
    return turn;
  }
  if (!has_graph) {
    for (const int tag_id : contribution.contradicted)
      follow |= quarantine_locked(contribution, tag_id);
    for (const TagBelief& belief : contribution.beliefs)
      follow |= absorb_locked(contribution.body_id, belief, utc_now_ns);
  }
  if (contribution.segment != nullptr) {
    segments_.push_back({contribution.body_id, contribution.segment});
    if (segments_.size() > kKeptSegments) segments_.erase(segments_.begin());
  }
  if (follow) publish_locked(utc_now_ns);
  return turn;
}

void MapBuilder::note_contradicted_once_locked(int body_id, int tag_id, const char* what_holds) {
  if (working_.find(tag_id) == nullptr || !contradicted_.insert(tag_id).second) return;
  note_locked(MapEvent::Kind::kTagDisputed, tag_id,
              "tag " + std::to_string(tag_id) + " is not where the map has it, by what body " +
                  std::to_string(body_id) + " sees; it stays there, for " + what_holds);
}

bool MapBuilder::quarantine_locked(const MapContribution& contribution, int tag_id) {
  MapTag* entry = working_.find(tag_id);
  if (entry == nullptr || entry->component != 0 || entry->state == TagState::kQuarantined)
    return false;
  if (entry->state == TagState::kSurveyed) {
    note_contradicted_once_locked(contribution.body_id, tag_id, "the survey holds");
    return false;
  }
  TagOwner& owner = ownership_[tag_id];
  const auto disputed_at = owner.disputed_at;
  if (disputed_at && contribution.at - *disputed_at < kDisputeHolds) return false;
  owner = {.quarantined_at = contribution.at, .before = entry->state, .disputed_at = disputed_at};
  entry->state = TagState::kQuarantined;
  if (!disputed_at) {
    note_locked(MapEvent::Kind::kTagQuarantined, tag_id,
                "tag " + std::to_string(tag_id) + " is not where the map has it, by what body " +
                    std::to_string(contribution.body_id) +
                    " sees; it is left out until it has been learned anew");
  }
  return true;
}

/// The first belief since the quarantine. @return false when the tag has not moved
bool MapBuilder::relearn_locked(int body_id, const TagBelief& belief, MapTag& entry,
                                TagOwner& owner) {
  const int id = belief.tag.tag_id;
  const double moved_m = (belief.tag.X_WT.p - entry.tag.X_WT.p).norm();
  if (moved_m < kMove_m && angle_between(belief.tag.X_WT.q, entry.tag.X_WT.q) < kMove_rad) {
    // Map and body are further apart than they claim. To take over one tag after the other would
    // bend the map after this body.
    if (!owner.disputed_at) {
      note_locked(MapEvent::Kind::kTagDisputed, id,
                  "tag " + std::to_string(id) + " is " + fixed(moved_m, 3) + " m from where body " +
                      std::to_string(body_id) +
                      " sees it, too little for a move; it stays where the map has it");
    }
    entry.state = owner.before;
    owner = {.disputed_at = belief.last_seen};
    return false;
  }
  note_locked(MapEvent::Kind::kTagMoved, id,
              "tag " + std::to_string(id) + " was learned anew, " + fixed(moved_m, 3) +
                  " m from where it was");
  entry.state = TagState::kLocal;
  owner = {.body_id = body_id};
  return true;
}

/// Whether this belief says more than the map does.
bool MapBuilder::accept_locked(int body_id, const TagBelief& belief, const MapTag& entry,
                               TagOwner& owner) {
  // What was seen before it moved is the old place.
  if (owner.quarantined_at) return belief.last_seen > *owner.quarantined_at;
  if (owner.disputed_at) return false;
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
  if (!ready(belief) || news_.is_behind(body_id, id)) return false;
  MapTag* entry = working_.find(id);
  const bool is_new = entry == nullptr;
  if (is_new) {
    entry = &add_locked(body_id, belief);
    entry->first_seen_utc_ns = utc_now_ns - (belief.last_seen - belief.first_seen).count();
  }
  const auto owned = ownership_.find(id);
  if (owned == ownership_.end()) return false;  // a fixed tag of the starting map
  TagOwner& owner = owned->second;
  if (!is_new && !accept_locked(body_id, belief, *entry, owner)) return false;
  has_workspace_ = true;
  if (owner.quarantined_at && !relearn_locked(body_id, belief, *entry, owner)) return true;
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

/// A tag that is looked at, and whose published place does not change any more, has settled.
bool MapBuilder::settle_locked(MapTag& entry, TagOwner& owner, bool moved) {
  if (moved || !owner.still_since) owner.still_since = owner.last_seen;
  if (entry.state != TagState::kLocal || entry.sightings < kSightingsToSettle ||
      owner.last_seen - *owner.still_since < kStillToSettle)
    return false;
  entry.state = TagState::kCalibrated;
  note_locked(MapEvent::Kind::kTagCalibrated, entry.tag.tag_id,
              "tag " + std::to_string(entry.tag.tag_id) + " has settled");
  return true;
}

MapTag& MapBuilder::add_locked(int body_id, const TagBelief& belief) {
  ownership_[belief.tag.tag_id] = {.body_id = body_id};
  return insert_locked(belief.tag, ", seen by body " + std::to_string(body_id));
}

MapTag& MapBuilder::insert_locked(const KnownTag& tag, const std::string& seen_by) {
  const int id = tag.tag_id;
  const auto place =
      std::lower_bound(working_.tags.begin(), working_.tags.end(), id,
                       [](const MapTag& entry, int tag_id) { return entry.tag.tag_id < tag_id; });
  note_locked(MapEvent::Kind::kTagAdded, id,
              "tag " + std::to_string(id) + " joined the map" + seen_by);
  return *working_.tags.insert(place, MapTag{.tag = tag});
}

std::uint64_t MapBuilder::adopt(GraphSolution solution, std::int64_t utc_now_ns) {
  KnownMap known;
  known.pairs = std::move(solution.pairs);
  known.is_judged = true;
  note_wrong(solution.findings, known);
  Instant newest = Instant::min();  // of the solution: about now
  for (const GraphTagEstimate& tag : solution.tags) newest = std::max(newest, tag.last_seen);
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen || begin_anew_ != nullptr) return contributions_;
  const int least = solution.least_sightings.value_or(config_.publish_sightings);
  for (const GraphTagEstimate& tag : solution.tags) {
    if (tag.component != 0 || tag.sightings < least) continue;
    if (moved_.is_outdated(tag)) continue;
    const KnownTag placed{tag.tag_id, tag.edge_m, tag.X_WT, tag.covariance};
    if (fault_in(MapTag{.tag = placed})) continue;
    MapTag* entry = working_.find(tag.tag_id);
    if (entry == nullptr) {
      entry = &insert_locked(placed, "");
      entry->first_seen_utc_ns = utc_now_ns - (newest - tag.first_seen).count();
    }
    if (entry->state == TagState::kSurveyed) continue;
    if (entry->state == TagState::kQuarantined && !find_again_locked(tag, solution.tags, *entry))
      continue;
    entry->tag = placed;
    entry->sightings = tag.sightings;
    if (tag.last_seen != Instant{})  // in this session
      entry->last_seen_utc_ns = utc_now_ns - (newest - tag.last_seen).count();
    if (tag.sightings >= kSightingsToSettle) entry->state = TagState::kCalibrated;
    known.tags.push_back(placed);
    has_workspace_ = true;
  }
  replace_known_locked(std::move(known));
  publish_locked(utc_now_ns);
  return contributions_;
}

/// With a revision of its own: filters take it over once.
void MapBuilder::replace_known_locked(KnownMap known) {
  known.revision = 1 + std::max(revision_, working_.known ? working_.known->revision : 0);
  working_.known = std::make_shared<const KnownMap>(std::move(known));
}

void MapBuilder::publish_locked(std::int64_t utc_now_ns) {
  working_.hash.clear();
  working_.created_utc_ns = utc_now_ns;
  changed_ = true;
  ++revision_;
  auto next = std::make_shared<const TagMap>(working_);
  const std::lock_guard lock(snapshot_mutex_);
  snapshot_.swap(next);
}

std::shared_ptr<const TagMap> MapBuilder::snapshot() const {
  const std::lock_guard lock(snapshot_mutex_);
  return snapshot_;
}

MapView MapBuilder::published() const {
  const std::lock_guard lock(mutex_);
  return {snapshot(), false, revision_};
}

bool MapBuilder::changed() const {
  const std::lock_guard lock(mutex_);
  return changed_;
}

void MapBuilder::mark_stored(const TagMap& stored) {
  const std::lock_guard lock(mutex_);
  // What joined while the store was writing is in no version yet.
  const bool more = !same_content(*snapshot_, stored);
  auto next = std::make_shared<TagMap>(*snapshot_);
  next->version = stored.version;
  next->parent = stored.parent;
  next->comment = stored.comment;
  next->hash = more ? std::string{} : stored.hash;
  note_locked(MapEvent::Kind::kPublished, 0,
              "map stored as version " + std::to_string(stored.version) + " with " +
                  std::to_string(stored.tags.size()) + " tags");
  working_.comment = stored.comment;
  // Nothing is thrown from here on: what is not marked is stored again.
  working_.version = stored.version;
  working_.parent = stored.parent;
  changed_ = more;
  std::shared_ptr<const TagMap> published = std::move(next);
  const std::lock_guard pointer_lock(snapshot_mutex_);
  snapshot_.swap(published);
}

void MapBuilder::note_locked(MapEvent::Kind kind, int tag_id, std::string text) {
  if (events_.size() == kKeptEvents) events_.erase(events_.begin());
  events_.push_back({kind, tag_id, std::move(text)});
}

std::vector<MapEvent> MapBuilder::take_events() {
  const std::lock_guard lock(mutex_);
  return std::exchange(events_, {});
}

}  // namespace fiducap
