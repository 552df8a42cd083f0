#include "mapping/map_builder.hpp"

#include <algorithm>
#include <utility>

#include "mapping/map_edit.hpp"

namespace fiducap {

namespace {

constexpr std::size_t kKeptEvents = 256;
constexpr std::size_t kKeptSegments = 1024;

bool same_content(const TagMap& a, const TagMap& b) {
  return a.X_RW.p == b.X_RW.p && a.X_RW.q.coeffs() == b.X_RW.q.coeffs() &&
         std::equal(a.tags.begin(), a.tags.end(), b.tags.begin(), b.tags.end(),
                    [](const MapTag& x, const MapTag& y) {
                      return x.tag.tag_id == y.tag.tag_id && x.tag.X_WT.p == y.tag.X_WT.p &&
                             x.tag.X_WT.q.coeffs() == y.tag.X_WT.q.coeffs() &&
                             x.tag.covariance == y.tag.covariance && x.state == y.state;
                    });
}

/// Completes what filters know of a map.
void add_uncorrelated(const TagMap& map, KnownMap& known) {
  known.uncorrelated.clear();
  for (const MapTag& entry : map.tags)
    if (entry.is_usable() && !known.is_joint(entry.tag.tag_id))
      known.uncorrelated.push_back(entry.tag);
}

/// Passes the findings to the filters.
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
      .within("publish_sightings", publish_sightings, 1, 1'000'000)
      .positive("refine_period_s", refine_period_s)
      .positive("commit_period_s", commit_period_s)
      .errors;
}

MapBuilder::MapBuilder(const MapConfig& config, TagMap start)
    : config_(config),
      snapshot_(std::make_shared<const TagMap>(start)),
      working_(std::move(start)),
      starts_with_workspace_(working_.has_workspace()),
      has_workspace_(starts_with_workspace_) {
  KnownMap known = working_.known ? *working_.known : KnownMap{};
  add_uncorrelated(working_, known);
  known.made_by.reset();
  working_.known = std::make_shared<const KnownMap>(std::move(known));
  snapshot_ = std::make_shared<const TagMap>(working_);
}

// --- the workspace ---

/// The reference tag *is* the workspace, for every body. Without one the first body defines it, and
/// no other may.
bool MapBuilder::may_define_locked(int body_id) const {
  if (is_solved_) return false;  // the graph defines W
  if (working_.reference_tag)
    return working_.find(*working_.reference_tag) == nullptr && !starts_with_workspace_;
  return !has_workspace_ && (!founder_ || *founder_ == body_id) &&
         (!defining_ || *defining_ == body_id);
}

MapView MapBuilder::view(int body_id) {
  const std::lock_guard lock(mutex_);
  const bool may_define = may_define_locked(body_id);
  if (may_define && !working_.reference_tag) defining_ = body_id;
  MapView view{snapshot(), may_define, revision_};
  view.body_id = body_id;
  return view;
}

void MapBuilder::release(int body_id) {
  const std::lock_guard lock(mutex_);
  if (defining_ == body_id) defining_.reset();
  if (founder_ == body_id && !has_workspace_) founder_.reset();
}

// --- contributions ---

std::uint64_t MapBuilder::absorb(const MapContribution& contribution, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  if (defining_ == contribution.body_id) defining_.reset();
  if (contribution.anchored && !founder_ && !working_.reference_tag && !has_workspace_) {
    founder_ = contribution.body_id;
    note_locked(MapEvent::Kind::kWorkspace, 0,
                "body " + std::to_string(contribution.body_id) +
                    " has defined the workspace by its first tag; all other bodies wait for a tag "
                    "of its map (with map.reference_tag any of them may begin)");
  }
  const std::uint64_t number = contributions_++;
  newest_at_ = std::max(newest_at_, contribution.at);
  if (contribution.revision < replaced_at_) return number;
  const bool has_changed = watch_locked(contribution, utc_now_ns);
  if (config_.mode == MapMode::kFrozen) return number;
  if (contribution.segment != nullptr) {
    contributors_.insert(contribution.body_id);
    segments_.push_back({contribution.body_id, contribution.segment});
    if (segments_.size() > kKeptSegments) segments_.erase(segments_.begin());
  }
  if (has_changed) publish_locked(utc_now_ns);
  return number;
}

void MapBuilder::note_contradicted_once_locked(int body_id, int tag_id, const char* reason) {
  if (working_.find(tag_id) == nullptr || !contradicted_.insert(tag_id).second) return;
  note_locked(MapEvent::Kind::kTagDisputed, tag_id,
              "tag " + std::to_string(tag_id) + " is not where the map has it, as seen by body " +
                  std::to_string(body_id) + "; its place is kept: " + reason);
}

MapTag& MapBuilder::insert_locked(const KnownTag& tag) {
  note_locked(MapEvent::Kind::kTagAdded, tag.tag_id,
              "tag " + std::to_string(tag.tag_id) + " joined the map");
  return working_.insert({.tag = tag});
}

// --- the graph ---

MapBuilder::Waiting MapBuilder::take_segments() {
  const std::lock_guard lock(mutex_);
  return {std::exchange(segments_, {}), std::exchange(replacement_, nullptr), moved_.take_orders(),
          contributions_};
}

/// @return true when the map is to be published
bool MapBuilder::watch_locked(const MapContribution& contribution, std::int64_t utc_now_ns) {
  if (!contribution.anchored) return false;
  std::vector<Contradiction> contradicted;
  for (const int tag_id : contribution.contradicted) {
    const MapTag* entry = working_.find(tag_id);
    if (entry == nullptr || entry->component != 0) continue;
    const auto own = std::ranges::find(contribution.beliefs, tag_id,
                                       [](const TagBelief& belief) { return belief.tag.tag_id; });
    contradicted.push_back(
        {entry->tag, own == contribution.beliefs.end() ? std::nullopt : std::optional(*own)});
  }
  bool follow = false;
  for (const TagDisplacement& displacement :
       watch_.report(contribution.body_id, contribution.at, contribution.fitting, contradicted))
    follow |= displace_locked(displacement, utc_now_ns);
  return follow;
}

/// @return true when the map is to be published
bool MapBuilder::displace_locked(const TagDisplacement& displacement, std::int64_t utc_now_ns) {
  const int tag_id = displacement.tag_id;
  MapTag& entry = *working_.find(tag_id);
  const bool is_frozen = config_.mode == MapMode::kFrozen;
  if (is_frozen || entry.state == TagState::kSurveyed) {
    note_contradicted_once_locked(displacement.body_id, tag_id,
                                  is_frozen ? "the map is frozen" : "it was surveyed");
    return false;
  }
  const auto event = moved_.displace(displacement, entry, utc_now_ns);
  if (!event) return false;
  note_locked(event->kind, tag_id, event->text);
  watch_.forget(tag_id);
  entry.state = TagState::kQuarantined;
  exclude_from_known_locked(tag_id);
  return true;
}

/// No filter uses the tag any more.
void MapBuilder::exclude_from_known_locked(int tag_id) {
  drop_correlations(working_, tag_id);
  replace_known_locked(*working_.known);
}

/// @param newest  last sighting of the solution: about now
/// @return the tag of the map; nullptr: the estimate is not used
const MapTag* MapBuilder::place_locked(const GraphTagEstimate& tag,
                                       std::span<const GraphTagEstimate> all, Instant newest,
                                       std::int64_t utc_now_ns) {
  const KnownTag placed{tag.tag_id, tag.edge_m, tag.X_WT, tag.covariance};
  if (fault_in(MapTag{.tag = placed})) return nullptr;
  MapTag* entry = working_.find(tag.tag_id);
  if (entry == nullptr) {
    entry = &insert_locked(placed);
    entry->first_seen_utc_ns = utc_now_ns - (newest - tag.first_seen).count();
  }
  if (entry->state == TagState::kSurveyed) return nullptr;
  if (entry->state == TagState::kQuarantined) {
    if (moved_.is_away(tag.tag_id)) {
      const auto verdict = moved_.locate(tag, all, *entry);
      if (!verdict) return nullptr;
      note_locked(verdict->event.kind, tag.tag_id, verdict->event.text);
      entry->state = verdict->state;
    } else {
      entry->state = TagState::kLocal;  // quarantined in another session, found in this one
    }
  }
  entry->tag = placed;
  entry->sightings = tag.sightings;
  if (tag.last_seen != Instant{})  // in this session
    entry->last_seen_utc_ns = utc_now_ns - (newest - tag.last_seen).count();
  if (tag.sightings >= kSightingsToSettle) entry->state = TagState::kCalibrated;
  return entry;
}

std::uint64_t MapBuilder::adopt(GraphSolution solution, std::int64_t utc_now_ns) {
  KnownMap known;
  known.pairs = std::move(solution.pairs);
  note_wrong(solution.findings, known);
  Instant newest = Instant::min();
  for (const GraphTagEstimate& tag : solution.tags) newest = std::max(newest, tag.last_seen);
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen || replacement_ != nullptr) return contributions_;
  const int least = solution.least_sightings.value_or(config_.publish_sightings);
  for (const GraphTagEstimate& tag : solution.tags) {
    if (tag.component != 0 || tag.sightings < least || moved_.is_outdated(tag)) continue;
    const MapTag* entry = place_locked(tag, solution.tags, newest, utc_now_ns);
    if (entry == nullptr) continue;
    known.tags.push_back(entry->tag);
    has_workspace_ = true;
  }
  is_solved_ = true;
  replace_known_locked(std::move(known));
  publish_locked(utc_now_ns);
  return contributions_;
}

/// With a new revision: filters adopt it once.
void MapBuilder::replace_known_locked(KnownMap known) {
  add_uncorrelated(working_, known);
  known.made_by.reset();
  if (!starts_with_workspace_ && contributors_.size() == 1) known.made_by = *contributors_.begin();
  known.revision = 1 + std::max(revision_, working_.known->revision);
  working_.known = std::make_shared<const KnownMap>(std::move(known));
}

// --- the published map ---

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
  // Tags that joined while the store was writing are in no version yet.
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
  // Nothing throws from here on: a map that is not marked is stored again.
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

void MapBuilder::set_mode(MapMode mode) {
  const std::lock_guard lock(mutex_);
  config_.mode = mode;
}

MapMode MapBuilder::mode() const {
  const std::lock_guard lock(mutex_);
  return config_.mode;
}

}  // namespace fiducap
