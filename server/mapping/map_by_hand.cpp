// MapBuilder for operators: changes of the map of a running server.
#include <algorithm>
#include <utility>

#include "mapping/map_builder.hpp"

namespace fiducap {

namespace {

Expected<void> refuse_frozen() {
  return fail(ErrorCode::kUnavailable,
              "the map is frozen, nothing in it may move: let it grow again first");
}

Expected<void> check_successor(const TagMap& map, const TagMap& of) {
  const std::string version = "version " + std::to_string(map.version);
  if (map.family != of.family)
    return fail(ErrorCode::kInvalid,
                version + " holds " + map.family + " tags, this server finds " + of.family);
  if (!map.has_workspace())
    return fail(ErrorCode::kInvalid, version + " has no tag that defines the workspace");
  return {};
}

}  // namespace

Expected<void> MapBuilder::check_replacement(const TagMap& map) const {
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen) return refuse_frozen();
  return check_successor(map, working_);
}

Expected<void> MapBuilder::replace_map(TagMap stored, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen) return refuse_frozen();
  if (auto fits = check_successor(stored, working_); !fits) return fits;
  replacement_ = std::make_shared<const TagMap>(stored);
  KnownMap known = stored.known ? *stored.known : KnownMap{};
  stored.known = working_.known;  // for the revision
  working_ = std::move(stored);
  starts_with_workspace_ = has_workspace_ = true;
  replace_known_locked(std::move(known));
  watch_ = {};
  moved_ = {};
  segments_.clear();
  contradicted_.clear();
  founder_.reset();
  defining_.reset();
  publish_locked(utc_now_ns);
  replaced_at_ = revision_;
  return {};
}

void MapBuilder::align(const Pose& X_RW, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  working_.X_RW = X_RW;
  publish_locked(utc_now_ns);
}

Expected<MapTag*> MapBuilder::tag_locked(int tag_id) {
  if (MapTag* entry = working_.find(tag_id)) return entry;
  return fail(ErrorCode::kNotFound, "the map has no tag " + std::to_string(tag_id));
}

Expected<void> MapBuilder::quarantine(int tag_id, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  const auto entry = tag_locked(tag_id);
  if (!entry) return tl::unexpected(entry.error());
  (*entry)->state = TagState::kQuarantined;
  moved_.exclude(tag_id, newest_at_);
  watch_.forget(tag_id);
  exclude_from_known_locked(tag_id);
  publish_locked(utc_now_ns);
  return {};
}

Expected<void> MapBuilder::forget(int tag_id, std::int64_t utc_now_ns) {
  const std::lock_guard lock(mutex_);
  if (config_.mode == MapMode::kFrozen) return refuse_frozen();
  if (const auto entry = tag_locked(tag_id); !entry) return tl::unexpected(entry.error());
  const std::string name = "tag " + std::to_string(tag_id);
  if (working_.reference_tag == tag_id)
    return fail(ErrorCode::kInvalid, name + " is the reference tag: it defines the workspace");
  TagMap rest = working_;
  std::erase_if(rest.tags, [&](const MapTag& tag) { return tag.tag.tag_id == tag_id; });
  if (!rest.has_workspace())
    return fail(ErrorCode::kInvalid, name + " is the only one that defines the workspace");
  working_ = std::move(rest);
  contradicted_.erase(tag_id);
  moved_.forget(tag_id, newest_at_);
  watch_.forget(tag_id);
  exclude_from_known_locked(tag_id);
  publish_locked(utc_now_ns);
  return {};
}

}  // namespace fiducap
