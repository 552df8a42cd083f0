#include "daemon/control_desk.hpp"

#include <algorithm>
#include <ctime>
#include <utility>

#include "base/log.hpp"
#include "daemon/operator_token.hpp"
#include "daemon/secret.hpp"
#include "daemon/system_clock.hpp"
#include "scene/body_name.hpp"

namespace fiducap {

namespace {

constexpr double kUnit = 1e-3;  // further from 1 a quaternion is a mistake, not rounding

std::string name_of_now() {
  const std::time_t now = static_cast<std::time_t>(utc_now_ns() / 1'000'000'000);
  std::tm broken{};
  gmtime_r(&now, &broken);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d_%H-%M-%S", &broken);
  return text.data();
}

}  // namespace

ControlDesk::ControlDesk(OperatorConfig config, Scene& scene, MapBuilder& map,
                         SessionRecorder& recorder, EventBoard& events, MapKeeper* keeper)
    : config_(std::move(config)),
      scene_(scene),
      map_(map),
      recorder_(recorder),
      events_(events),
      keeper_(keeper) {
  for (const Scene::Listed& body : scene_.list())
    configured_names_.push_back(body.description.name);
}

bool ControlDesk::admits(std::string_view token) const { return is_secret(token, config_.token); }

std::vector<OperatorDesk::Body> ControlDesk::bodies() const {
  std::vector<Body> all;
  for (const Scene::Listed& body : scene_.list())
    all.push_back({body.description.id, body.description.name, body.enabled, body.X_BP});
  return all;
}

Expected<std::size_t> ControlDesk::index_of(int body_id) const {
  const auto list = scene_.list();
  for (std::size_t i = 0; i < list.size(); ++i)
    if (list[i].description.id == body_id) return i;
  return fail(ErrorCode::kNotFound, "there is no body with id " + std::to_string(body_id));
}

Expected<void> ControlDesk::set_enabled(int body_id, bool enabled) {
  const auto body = index_of(body_id);
  if (!body) return tl::unexpected(body.error());
  scene_.set_enabled(*body, enabled);
  log::info("daemon", "body " + std::to_string(body_id) +
                          (enabled ? " is streamed again" : " is streamed no more"));
  return {};
}

Expected<void> ControlDesk::rename(int body_id, const std::string& name) {
  const auto body = index_of(body_id);
  if (!body) return tl::unexpected(body.error());
  if (const auto fault = body_name_fault(name))
    return fail(ErrorCode::kInvalid, "a body's name " + *fault, shown_name(name));
  for (const Scene::Listed& other : scene_.list())
    if (other.description.id != body_id && other.description.name == name)
      return fail(ErrorCode::kInvalid, "another body has this name", shown_name(name));
  scene_.rename(*body, name);
  events_.rename(configured_names_.at(*body), name);
  log::info("daemon",
            "body " + std::to_string(body_id) + " is called " + name + " until the server ends");
  return {};
}

Expected<void> ControlDesk::set_pivot(int body_id, const Pose& X_BP) {
  const auto body = index_of(body_id);
  if (!body) return tl::unexpected(body.error());
  if (!X_BP.p.allFinite() || !X_BP.q.coeffs().allFinite() || std::abs(X_BP.q.norm() - 1.0) > kUnit)
    return fail(ErrorCode::kInvalid, "a pivot needs finite numbers and a unit quaternion");
  scene_.set_pivot(*body, {X_BP.q.normalized(), X_BP.p});
  return {};
}

Expected<void> ControlDesk::start_recording(const std::string& name) {
  return recorder_.start(name.empty() ? name_of_now() : name);
}

}  // namespace fiducap
