// What an operator does to the map of a running server: a part of MapBuilder.
#include <algorithm>
#include <utility>

#include "mapping/map_builder.hpp"

namespace fiducap {

namespace {

Expected<void> refuse_frozen() {
  return fail(ErrorCode::kUnavailable,
              "the map is frozen, nothing in it may move: let it grow again first");
}

/// For filters, of a map whose errors' ties are not known: each tag stands alone.
KnownMap places_of(const TagMap& map) {
  KnownMap known;
  for (const MapTag& entry : map.tags)
    if (entry.component == 0 && entry.state != TagState::kQuarantined)
      known.tags.push_back(entry.tag);
  return known;
}

Expected<void> check_successor(const TagMap& map, const TagMap& of) {
  const std::string version = "version " + std::to_string(map.version);
  if (map.family != of.family)
    return fail(ErrorCode::kInvalid,
                version + " holds " + map.family + " tags, this server finds " + of.family);
  if (!has_places(map))
    return fail(ErrorCode::kInvalid, version + " has no tag that says where the workspace is");
  return {};
}

}  // namespace

/// Some tag says where the workspace is.
bool has_places(const TagMap& map) {
  return std::any_of(map.tags.begin(), map.tags.end(), [](const MapTag& entry) {
    return entry.component == 0 && entry.state != TagState::kQuarantined;
  });
}

Expected<void> MapBuilder::may_begin_anew(const TagMap& map) const {
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen) return refuse_frozen();
  return check_successor(map, working_);
}

Expected<void> MapBuilder::begin_anew(TagMap stored, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen) return refuse_frozen();
  if (auto fits = check_successor(stored, working_); !fits) return fits;
  const bool has_graph = config_.refine_period_s > 0;
  if (has_graph) begin_anew_ = std::make_shared<const TagMap>(stored);
  KnownMap known = stored.known ? *stored.known : places_of(stored);
  stored.known = working_.known;  // for the revision
  working_ = std::move(stored);
  replace_known_locked(std::move(known));
  news_.replace(has_graph ? nullptr : std::make_shared<const TagMap>(working_));
  if (!has_graph) working_.known.reset();
  ownership_ = owners_of(working_);
  watch_ = {};
  moved_ = {};
  segments_.clear();
  contradicted_.clear();
  founder_.reset();
  defining_.reset();
  starts_with_places_ = has_workspace_ = true;
  publish_locked(utc_now_ns);
  return {};
}

void MapBuilder::align(const Pose& X_RW, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  working_.X_RW = X_RW;
  publish_locked(utc_now_ns);
}

Expected<MapTag*> MapBuilder::tag_locked(int tag_id) {
  MapTag* entry = working_.find(tag_id);
  if (entry == nullptr)
    return fail(ErrorCode::kNotFound, "the map has no tag " + std::to_string(tag_id));
  return entry;
}

Expected<void> MapBuilder::quarantine(int tag_id, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  const auto entry = tag_locked(tag_id);
  if (!entry) return tl::unexpected(entry.error());
  (*entry)->state = TagState::kQuarantined;
  ownership_[tag_id] = {.quarantined_at = Instant::max()};  // no belief is newer
  if (config_.refine_period_s > 0) moved_.set_aside(tag_id, newest_at_);
  watch_.forget(tag_id);
  leave_out_locked(tag_id);
  publish_locked(utc_now_ns);
  return {};
}

Expected<void> MapBuilder::forget(int tag_id, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen) return refuse_frozen();
  const auto entry = tag_locked(tag_id);
  if (!entry) return tl::unexpected(entry.error());
  const std::string name = "tag " + std::to_string(tag_id);
  if (working_.reference_tag == tag_id)
    return fail(ErrorCode::kInvalid, name + " is the reference tag: the workspace hangs on it");
  TagMap rest = working_;
  std::erase_if(rest.tags, [&](const MapTag& tag) { return tag.tag.tag_id == tag_id; });
  if (!has_places(rest))
    return fail(ErrorCode::kInvalid, name + " is the only one that says where the workspace is");
  working_ = std::move(rest);
  ownership_.erase(tag_id);
  contradicted_.erase(tag_id);
  if (config_.refine_period_s > 0) moved_.forget(tag_id, newest_at_);
  watch_.forget(tag_id);
  news_.forget(tag_id);
  leave_out_locked(tag_id);
  publish_locked(utc_now_ns);
  return {};
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
