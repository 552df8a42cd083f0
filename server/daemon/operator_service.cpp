#include "daemon/operator_service.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/chrono.h>

#include "base/text.hpp"
#include "daemon/system.hpp"
#include "scene/body_name.hpp"

namespace fiducap {
namespace {

constexpr double kUnit = 1e-3;  // larger errors of a quaternion's norm are no rounding

// Largest error of a tag's position by tape or total station.
constexpr double kMostOff_m = 0.05;

std::string tag_named(int tag_id) { return "tag " + std::to_string(tag_id); }
std::string body_named(int body_id) { return "body " + std::to_string(body_id); }

std::string text_of(const CommitVersion& one) { return "store the map as \"" + one.name + "\""; }
std::string text_of(const NameVersion& one) {
  return "name version " + std::to_string(one.version) + " \"" + one.name + "\"";
}
std::string text_of(const RollBack& one) {
  return "roll the map back to version " + std::to_string(one.version);
}
std::string text_of(const AlignMap& one) {
  return "align the map to " + std::to_string(one.places.size()) + " tags";
}
std::string text_of(const QuarantineTag& one) { return "quarantine " + tag_named(one.tag_id); }
std::string text_of(const ForgetTag& one) { return "forget " + tag_named(one.tag_id); }

}  // namespace

OperatorService::OperatorService(AccessKeeper& access, Scene& scene, MapBuilder& map,
                                 SessionRecorder& recorder, EventBoard& events, MapKeeper* keeper)
    : access_(access),
      scene_(scene),
      map_(map),
      recorder_(recorder),
      events_(events),
      keeper_(keeper) {
  for (const Scene::Listed& body : scene_.list())
    configured_names_.push_back(body.description.name);
}

std::vector<OperatorApi::Body> OperatorService::bodies() const {
  std::vector<Body> all;
  for (const Scene::Listed& body : scene_.list())
    all.push_back({body.description.id, body.description.name, body.enabled, body.X_BP});
  return all;
}

Expected<std::size_t> OperatorService::index_of(int body_id) const {
  const auto list = scene_.list();
  for (std::size_t i = 0; i < list.size(); ++i)
    if (list[i].description.id == body_id) return i;
  return fail(ErrorCode::kNotFound, "there is no body with id " + std::to_string(body_id));
}

Expected<void> OperatorService::set_enabled(const Requester& by, int body_id, bool enabled) {
  auto done = enable(body_id, enabled);
  access_.note(by, (enabled ? "enable " : "disable ") + body_named(body_id), done);
  return done;
}

Expected<void> OperatorService::rename(const Requester& by, int body_id, const std::string& name) {
  auto done = give_name(body_id, name);
  access_.note(by, "rename " + body_named(body_id) + " to \"" + name + "\"", done);
  return done;
}

Expected<void> OperatorService::set_pivot(const Requester& by, int body_id, const Pose& X_BP) {
  auto done = move_pivot(body_id, X_BP);
  const Eigen::Vector3d& p = X_BP.p;
  access_.note(by,
               "move the pivot of " + body_named(body_id) + " to " +
                   comma_list(std::array{p.x(), p.y(), p.z()}, shortest) + " m",
               done);
  return done;
}

Expected<void> OperatorService::set_map_mode(const Requester& by, MapMode mode) {
  auto done = change_mode(mode);
  access_.note(by, mode == MapMode::kFrozen ? "freeze the map" : "let the map grow", done);
  return done;
}

Expected<void> OperatorService::change_map(const Requester& by, const MapChange& wanted) {
  auto done = std::visit([this](const auto& one) { return change(one); }, wanted);
  access_.note(by, std::visit([](const auto& one) { return text_of(one); }, wanted), done);
  return done;
}

Expected<void> OperatorService::start_recording(const Requester& by, const std::string& wanted) {
  const std::string name = wanted.empty() ? fmt::format("{:%Y-%m-%d_%H-%M-%S}",
                                                        fmt::gmtime(utc_now_ns() / 1'000'000'000))
                                          : wanted;
  auto done = recorder_.start(name);
  access_.note(by, "start the recording \"" + name + "\"", done);
  return done;
}

Expected<void> OperatorService::stop_recording(const Requester& by) {
  auto done = recorder_.stop();
  access_.note(by, "stop the recording", done);
  return done;
}

Expected<void> OperatorService::enable(int body_id, bool enabled) {
  const auto body = index_of(body_id);
  if (!body) return tl::unexpected(body.error());
  scene_.set_enabled(*body, enabled);
  return {};
}

Expected<void> OperatorService::give_name(int body_id, const std::string& name) {
  const auto body = index_of(body_id);
  if (!body) return tl::unexpected(body.error());
  if (const auto fault = body_name_fault(name))
    return fail(ErrorCode::kInvalid, "a body's name " + *fault, shown_name(name));
  for (const Scene::Listed& other : scene_.list())
    if (other.description.id != body_id && other.description.name == name)
      return fail(ErrorCode::kInvalid, "another body has this name", shown_name(name));
  scene_.rename(*body, name);
  events_.rename(configured_names_.at(*body), name);
  return {};
}

Expected<void> OperatorService::move_pivot(int body_id, const Pose& X_BP) {
  const auto body = index_of(body_id);
  if (!body) return tl::unexpected(body.error());
  if (!X_BP.p.allFinite() || !X_BP.q.coeffs().allFinite() || std::abs(X_BP.q.norm() - 1.0) > kUnit)
    return fail(ErrorCode::kInvalid, "a pivot needs finite numbers and a unit quaternion");
  scene_.set_pivot(*body, {X_BP.q.normalized(), X_BP.p});
  return {};
}

Expected<void> OperatorService::change_mode(MapMode mode) {
  const bool is_frozen = mode == MapMode::kFrozen;
  if (is_frozen && map_.snapshot()->tags.empty())
    return fail(ErrorCode::kUnavailable,
                "there is no tag in the map yet: frozen, it would stay empty and no body would be "
                "tracked. Show tags to a robot and wait until they have joined");
  map_.set_mode(mode);
  report(is_frozen ? "frozen" : "mapping", is_frozen ? "is frozen" : "grows again");
  return {};
}

Expected<void> OperatorService::change(const CommitVersion& wanted) {
  if (!wanted.name.empty()) {
    if (auto good = check_version_name(wanted.name); !good) return good;
  }
  return ask_keeper(wanted);
}

Expected<void> OperatorService::change(const NameVersion& wanted) {
  if (auto good = check_version_name(wanted.name); !good) return good;
  if (auto known = knows_version(wanted.version); !known) return known;
  return ask_keeper(wanted);
}

Expected<void> OperatorService::change(const RollBack& wanted) {
  if (map_.mode() == MapMode::kFrozen) return map_.check_replacement(*map_.snapshot());
  if (auto known = knows_version(wanted.version); !known) return known;
  return ask_keeper(wanted);
}

Expected<void> OperatorService::change(const AlignMap& wanted) {
  const auto aligned = align(*map_.snapshot(), wanted.places, kMostOff_m);
  if (!aligned) return tl::unexpected(aligned.error());
  map_.align(aligned->X_RW, utc_now_ns());
  double worst_m = 0;
  for (const auto& one : aligned->residuals) worst_m = std::max(worst_m, one.off_m.norm());
  report("aligned", "is aligned to " + std::to_string(wanted.places.size()) +
                        " measured tags, within " + fixed(1e3 * worst_m, 0) + " mm");
  return {};
}

Expected<void> OperatorService::change(const QuarantineTag& wanted) {
  auto done = map_.quarantine(wanted.tag_id, utc_now_ns());
  if (done)
    report("tag_quarantined", tag_named(wanted.tag_id) +
                                  " is not used any more, by an operator, until it is forgotten");
  return done;
}

Expected<void> OperatorService::change(const ForgetTag& wanted) {
  auto done = map_.forget(wanted.tag_id, utc_now_ns());
  if (done)
    report("tag_forgotten", tag_named(wanted.tag_id) +
                                " was forgotten, by an operator: seen again, it is a new one");
  return done;
}

Expected<void> OperatorService::ask_keeper(StoreChange wanted) {
  if (keeper_ == nullptr)
    return fail(ErrorCode::kUnsupported,
                "the map has no store; set map.store to keep it from run to run");
  return keeper_->request(std::move(wanted));
}

Expected<void> OperatorService::knows_version(std::int64_t version) const {
  if (keeper_ == nullptr || keeper_->versions().has(version)) return {};
  return fail(ErrorCode::kNotFound,
              "there is no version " + std::to_string(version) + " in the store");
}

std::vector<MapVersionInfo> OperatorService::map_versions() const {
  return keeper_ == nullptr ? std::vector<MapVersionInfo>{} : *keeper_->versions().log();
}

Expected<std::shared_ptr<const TagMap>> OperatorService::map_version(std::int64_t version) const {
  if (keeper_ == nullptr) return OperatorApi::map_version(version);
  return keeper_->versions().version(version);
}

void OperatorService::report(const char* kind, std::string text) {
  events_.report({.subject = "map", .kind = kind, .text = std::move(text)});
}

}  // namespace fiducap
