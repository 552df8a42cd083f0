#include "mapping/map_builder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/so3.hpp"

namespace fiducap {

namespace {

// The variance another belief must fall below to replace an owner's: keeps two equally good bodies
// from taking turns.
constexpr double kBetterBy = 0.7;
constexpr double kMoved_m = 1e-4;
constexpr double kTurned_rad = 0.01 * M_PI / 180.0;
constexpr double kSigmaChanged = 0.1;
constexpr std::size_t kKeptEvents = 256;

double position_variance(const KnownTag& tag) { return tag.covariance.diagonal().head<3>().sum(); }

bool differs_visibly(const KnownTag& now, const KnownTag& published) {
  const double before = std::sqrt(position_variance(published));
  return (now.X_WT.p - published.X_WT.p).norm() > kMoved_m ||
         angle_between(now.X_WT.q, published.X_WT.q) > kTurned_rad ||
         std::abs(std::sqrt(position_variance(now)) - before) > kSigmaChanged * before;
}

bool same_tags(const TagMap& a, const TagMap& b) {
  return std::equal(a.tags.begin(), a.tags.end(), b.tags.begin(), b.tags.end(),
                    [](const MapTag& x, const MapTag& y) {
                      return x.tag.tag_id == y.tag.tag_id && x.tag.X_WT.p == y.tag.X_WT.p &&
                             x.tag.X_WT.q.coeffs() == y.tag.X_WT.q.coeffs() &&
                             x.tag.covariance == y.tag.covariance && x.state == y.state;
                    });
}

MapTag* find_in(TagMap& map, int tag_id) {
  const MapTag* found = map.find(tag_id);
  return found == nullptr ? nullptr : &map.tags[static_cast<std::size_t>(found - map.tags.data())];
}

}  // namespace

std::vector<ConfigError> MapConfig::check() const {
  return Checker{"map."}
      .positive("publish_position_sigma_m", publish_position_sigma_m)
      .positive("publish_rotation_sigma_rad", publish_rotation_sigma_rad)
      .within("publish_sightings", publish_sightings, 1, 1'000'000)
      .positive("commit_period_s", commit_period_s)
      .errors;
}

MapBuilder::MapBuilder(const MapConfig& config, TagMap start)
    : config_(config),
      snapshot_(std::make_shared<const TagMap>(start)),
      working_(std::move(start)) {
  for (const MapTag& entry : working_.tags) {
    if (entry.state == TagState::kLocal) ownership_[entry.tag.tag_id] = {};
  }
}

bool MapBuilder::ready(const TagBelief& belief) const {
  const auto variances = belief.tag.covariance.diagonal().array();
  if (belief.sightings < config_.publish_sightings || fault_in(MapTag{.tag = belief.tag}))
    return false;
  const double position = config_.publish_position_sigma_m;
  const double rotation = config_.publish_rotation_sigma_rad;
  return variances.head<3>().maxCoeff() <= position * position &&
         variances.tail<3>().maxCoeff() <= rotation * rotation;
}

void MapBuilder::absorb(int body_id, std::span<const TagBelief> beliefs, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen) return;
  bool follow = false;
  for (const TagBelief& belief : beliefs) {
    if (ready(belief)) follow |= absorb_locked(body_id, belief, utc_now_ns);
  }
  if (follow) publish_locked(utc_now_ns);
}

bool MapBuilder::absorb_locked(int body_id, const TagBelief& belief, std::int64_t utc_now_ns) {
  const int id = belief.tag.tag_id;
  MapTag* entry = find_in(working_, id);
  if (entry == nullptr) {
    entry = &add_locked(body_id, belief);
    entry->first_seen_utc_ns = utc_now_ns - (belief.last_seen - belief.first_seen).count();
  }
  const auto owned = ownership_.find(id);
  if (owned == ownership_.end()) return false;  // a fixed tag of the starting map

  Ownership& owner = owned->second;
  const double offered = position_variance(belief.tag);
  const double held = position_variance(entry->tag);
  if (owner.body_id != body_id) {
    if (offered >= kBetterBy * held) return false;
    owner = {body_id, {}};
    note_locked(
        MapEvent::Kind::kTagRefined, id,
        "tag " + std::to_string(id) + " is known better by body " + std::to_string(body_id));
  } else if (kBetterBy * offered > held) {
    return false;
  }
  entry->tag = belief.tag;
  entry->sightings = belief.sightings;
  if (belief.last_seen > owner.last_seen) entry->last_seen_utc_ns = utc_now_ns;
  owner.last_seen = belief.last_seen;
  const MapTag* published = snapshot_->find(id);
  return published == nullptr || differs_visibly(entry->tag, published->tag);
}

MapTag& MapBuilder::add_locked(int body_id, const TagBelief& belief) {
  const int id = belief.tag.tag_id;
  const auto place =
      std::lower_bound(working_.tags.begin(), working_.tags.end(), id,
                       [](const MapTag& entry, int tag_id) { return entry.tag.tag_id < tag_id; });
  ownership_[id] = {body_id, {}};
  note_locked(
      MapEvent::Kind::kTagAdded, id,
      "tag " + std::to_string(id) + " joined the map, seen by body " + std::to_string(body_id));
  return *working_.tags.insert(place, MapTag{.tag = belief.tag});
}

void MapBuilder::publish_locked(std::int64_t utc_now_ns) {
  working_.hash.clear();
  working_.created_utc_ns = utc_now_ns;
  changed_ = true;
  auto next = std::make_shared<const TagMap>(working_);
  const std::lock_guard lock(snapshot_mutex_);
  snapshot_.swap(next);
}

std::shared_ptr<const TagMap> MapBuilder::snapshot() const {
  const std::lock_guard lock(snapshot_mutex_);
  return snapshot_;
}

bool MapBuilder::changed() const {
  const std::lock_guard lock(mutex_);
  return changed_;
}

void MapBuilder::mark_stored(const TagMap& stored) {
  const std::lock_guard lock(mutex_);
  working_.version = stored.version;
  working_.parent = stored.parent;
  working_.comment = stored.comment;
  // What joined while the store was writing is in no version yet.
  changed_ = !same_tags(*snapshot_, stored);
  auto next = std::make_shared<TagMap>(*snapshot_);
  next->version = stored.version;
  next->parent = stored.parent;
  next->comment = stored.comment;
  next->hash = changed_ ? std::string{} : stored.hash;
  note_locked(MapEvent::Kind::kPublished, 0,
              "map stored as version " + std::to_string(stored.version) + " with " +
                  std::to_string(stored.tags.size()) + " tags");
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
