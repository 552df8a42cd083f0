// What an operator changes of the map: a part of ControlDesk.
#include <algorithm>
#include <utility>

#include "base/log.hpp"
#include "base/text.hpp"
#include "daemon/control_desk.hpp"
#include "daemon/system_clock.hpp"

namespace fiducap {

namespace {

// What somebody who measures a tag's middle with a tape or a total station may be off.
constexpr double kMostOff_m = 0.05;

std::string tag_named(int tag_id) { return "tag " + std::to_string(tag_id); }

}  // namespace

Expected<void> ControlDesk::set_map_mode(MapMode mode) {
  const bool is_frozen = mode == MapMode::kFrozen;
  if (is_frozen && map_.snapshot()->tags.empty())
    return fail(ErrorCode::kUnavailable,
                "there is no tag in the map yet: frozen, it would never get one and no body would "
                "be tracked. Show tags to a robot and wait until they have joined");
  map_.set_mode(mode);
  tell(is_frozen ? "frozen" : "mapping", is_frozen ? "is frozen" : "grows again");
  return {};
}

Expected<void> ControlDesk::change_map(const MapChange& wanted) {
  return std::visit([this](const auto& one) { return change(one); }, wanted);
}

Expected<void> ControlDesk::change(const CommitVersion& wanted) {
  if (!wanted.name.empty()) {
    if (auto good = check_version_name(wanted.name); !good) return good;
  }
  return ask_keeper(wanted);
}

Expected<void> ControlDesk::change(const NameVersion& wanted) {
  if (auto good = check_version_name(wanted.name); !good) return good;
  if (auto known = knows_version(wanted.version); !known) return known;
  return ask_keeper(wanted);
}

Expected<void> ControlDesk::change(const RollBack& wanted) {
  if (map_.mode() == MapMode::kFrozen) return map_.may_begin_anew(*map_.snapshot());
  if (auto known = knows_version(wanted.version); !known) return known;
  return ask_keeper(wanted);
}

Expected<void> ControlDesk::change(const AlignMap& wanted) {
  const auto aligned = align(*map_.snapshot(), wanted.places, kMostOff_m);
  if (!aligned) return tl::unexpected(aligned.error());
  map_.align(aligned->X_RW, utc_now_ns());
  double worst_m = 0;
  for (const auto& one : aligned->residuals) worst_m = std::max(worst_m, one.off_m.norm());
  tell("aligned", "lies in the room as " + std::to_string(wanted.places.size()) +
                      " measured tags say, within " + fixed(1e3 * worst_m, 0) + " mm");
  return {};
}

Expected<void> ControlDesk::change(const QuarantineTag& wanted) {
  auto done = map_.quarantine(wanted.tag_id, utc_now_ns());
  if (done)
    tell("tag_quarantined",
         tag_named(wanted.tag_id) +
             " is not used any more, an operator says so: until it is forgotten");
  return done;
}

Expected<void> ControlDesk::change(const ForgetTag& wanted) {
  auto done = map_.forget(wanted.tag_id, utc_now_ns());
  if (done)
    tell("tag_forgotten", tag_named(wanted.tag_id) +
                              " was forgotten, an operator says so: seen again, it is a new one");
  return done;
}

Expected<void> ControlDesk::ask_keeper(StoreChange wanted) {
  if (keeper_ == nullptr)
    return fail(ErrorCode::kUnsupported,
                "the map has no store; set map.store to keep it from run to run");
  return keeper_->request(std::move(wanted));
}

Expected<void> ControlDesk::knows_version(std::int64_t version) const {
  if (keeper_ == nullptr || keeper_->shelf().has(version)) return {};
  return fail(ErrorCode::kNotFound,
              "there is no version " + std::to_string(version) + " in the store");
}

std::vector<MapVersionInfo> ControlDesk::map_versions() const {
  return keeper_ == nullptr ? std::vector<MapVersionInfo>{} : *keeper_->shelf().log();
}

Expected<std::shared_ptr<const TagMap>> ControlDesk::map_version(std::int64_t version) const {
  if (keeper_ == nullptr) return OperatorDesk::map_version(version);
  return keeper_->shelf().version(version);
}

void ControlDesk::tell(const char* kind, std::string text) {
  events_.tell({.subject = "map", .kind = kind, .text = std::move(text)});
}

}  // namespace fiducap
