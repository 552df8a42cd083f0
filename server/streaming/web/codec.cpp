#include "streaming/web/codec.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

namespace fiducap::web {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kLongestText = 1000;
constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kMillimetres = 1e3;

// Digits a page can show, no more: a frame is a third as long as with all of a double's digits. As
// a quotient, so that 0.1 is written `0.1` and not `0.09999999999999999`.
double rounded(double value, double parts) { return std::round(value * parts) / parts; }
double micro(double value) { return rounded(value, 1e6); }
double milli(double value) { return rounded(value, 1e3); }

Json vector_json(const Eigen::Vector3d& v) {
  return Json::array({micro(v.x()), micro(v.y()), micro(v.z())});
}

Json quaternion_json(const Eigen::Quaterniond& q) {
  return Json::array({micro(q.w()), micro(q.x()), micro(q.y()), micro(q.z())});
}

template <typename Derived>
Json covariance_json(const Eigen::MatrixBase<Derived>& c) {
  Json upper = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = row; column < 3; ++column) upper.push_back(rounded(c(row, column), 1e12));
  }
  return upper;
}

double to_ms(Duration d) { return milli(to_seconds(d) * 1e3); }

// Bytes that are not UTF-8 (a body's name, a peer's text) become U+FFFD instead of an exception.
std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// Every pose a filter gave has a covariance. Without one the zeros are no place, not even an old
// one.
bool was_ever_placed(const BodyPose& body) {
  return body.valid || body.covariance.diagonal().head<3>().maxCoeff() > 0;
}

void add_pose(Json& out, const BodyPose& body) {
  if (!was_ever_placed(body)) {
    for (const char* name :
         {"p", "q", "v", "speed", "turn_rate_deg_s", "sigma_mm", "sigma_deg", "cov", "age_ms"}) {
      out[name] = nullptr;
    }
    return;
  }
  out["p"] = vector_json(body.X_WP.p);
  out["q"] = quaternion_json(body.X_WP.q);
  out["v"] = vector_json(body.v_WP);
  out["speed"] = milli(body.v_WP.norm());
  out["turn_rate_deg_s"] = milli(body.w_WP_P.norm() * kDegrees);
  out["sigma_mm"] = milli(body.position_sigma_m() * kMillimetres);
  out["sigma_deg"] = milli(body.rotation_sigma_rad() * kDegrees);
  out["cov"] = covariance_json(body.covariance.topLeftCorner<3, 3>());
  out["age_ms"] = to_ms(body.age);
}

Json body_json(const BodyPose& body) {
  Json out;
  out["id"] = body.body_id;
  out["state"] = name_of(body.state);
  out["valid"] = body.valid;
  add_pose(out, body);
  out["latency_ms"] = to_ms(body.processing);
  out["tags"] = body.tags_in_view;
  out["image_rate_hz"] = milli(body.image_rate_hz);
  out["reprojection_px"] = milli(body.reprojection_px);
  out["images_dropped"] = body.images_dropped;
  return out;
}

Json tag_json(const MapTag& entry) {
  const auto position = entry.tag.covariance.topLeftCorner<3, 3>();
  Json out;
  out["id"] = entry.tag.tag_id;
  out["edge_m"] = micro(entry.tag.edge_m);
  out["state"] = name_of(entry.state);
  out["component"] = entry.component;
  out["sightings"] = entry.sightings;
  out["p"] = vector_json(entry.tag.X_WT.p);
  out["q"] = quaternion_json(entry.tag.X_WT.q);
  out["sigma_mm"] = milli(std::sqrt(position.diagonal().maxCoeff()) * kMillimetres);
  out["cov"] = covariance_json(position);
  return out;
}

Json event_json(const Event& event) {
  return {{"n", event.number},
          {"utc_ms", event.utc_ms},
          {"severity", name_of(event.severity)},
          {"subject", event.subject},
          {"kind", event.kind},
          {"text", event.text.substr(0, kLongestText)},
          {"remedy", event.remedy.substr(0, kLongestText)},
          {"over", event.over}};
}

}  // namespace

std::string encode_hello(const Hello& hello, const SceneModel& model) {
  Json out{{"type", "hello"},
           {"server", hello.server_name},
           {"version", hello.version},
           {"map_mode", hello.map_mode},
           {"page_rate_hz", hello.rate_hz},
           {"bodies", Json::array()}};
  for (const auto& body : model.bodies)
    out["bodies"].push_back({{"id", body.id}, {"name", body.name}});
  return text_of(out);
}

std::string encode_map(const TagMap& map) {
  Json out{{"type", "map"},
           {"version", map.version},
           {"parent", map.parent},
           {"hash", map.hash},
           {"family", map.family},
           {"reference_tag", map.reference_tag ? Json(*map.reference_tag) : Json(nullptr)},
           {"comment", map.comment},
           {"tags", Json::array()}};
  for (const auto& entry : map.tags) out["tags"].push_back(tag_json(entry));
  return text_of(out);
}

std::string encode_frame(const SceneFrame& frame) {
  Json out{{"type", "frame"},
           {"number", frame.number},
           {"utc_ms", frame.utc_ns() / 1'000'000},
           {"rate_hz", milli(frame.rate_hz)},
           {"map_version", frame.map ? Json(frame.map->version) : Json(nullptr)},
           {"bodies", Json::array()}};
  for (const auto& body : frame.bodies) out["bodies"].push_back(body_json(body));
  return text_of(out);
}

std::string encode_clients(std::span<const ClientStatus> clients) {
  Json out{{"type", "clients"}, {"clients", Json::array()}};
  for (const auto& client : clients) {
    const auto& clock = client.clock;
    out["clients"].push_back({{"protocol", client.protocol},
                              {"peer", client.peer},
                              {"detail", client.detail},
                              {"sent", client.frames_sent},
                              {"dropped", client.frames_dropped},
                              {"connected_s", milli(client.connected_s)},
                              {"clock_offset_s", clock ? Json(clock->offset_s) : Json(nullptr)},
                              {"clock_sigma_s", clock ? Json(clock->sigma_s) : Json(nullptr)}});
  }
  return text_of(out);
}

std::string encode_log(std::span<const log::Line> lines) {
  Json out{{"type", "log"}, {"lines", Json::array()}};
  for (const auto& line : lines) {
    out["lines"].push_back({{"n", line.number},
                            {"utc_ms", line.utc_ms},
                            {"level", log::name_of(line.level)},
                            {"room", line.room},
                            {"text", line.text.substr(0, kLongestText)}});
  }
  return text_of(out);
}

std::string encode_events(std::span<const Event> standing, std::span<const Event> newest) {
  Json out{{"type", "events"}, {"standing", Json::array()}, {"events", Json::array()}};
  for (const auto& event : standing) out["standing"].push_back(event_json(event));
  for (const auto& event : newest) out["events"].push_back(event_json(event));
  return text_of(out);
}

std::string encode_state(const StateParts& parts) {
  std::string out = "{";
  const auto add = [&out](std::string_view name, std::string_view json) {
    if (out.size() > 1) out += ',';
    out.append("\"").append(name).append("\":").append(json.empty() ? "null" : json);
  };
  add("hello", parts.hello);
  add("map", parts.map);
  add("frame", parts.frame);
  add("clients", parts.clients);
  add("log", parts.log);
  add("events", parts.events);
  return out += '}';
}

}  // namespace fiducap::web
