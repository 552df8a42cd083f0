#include "streaming/web/codec.hpp"

#include <array>
#include <charconv>
#include <limits>

#include <nlohmann/json.hpp>

#include "mapping/tag_map.hpp"

namespace fiducap::web {

namespace {

constexpr std::size_t kLongestText = 1000;
constexpr double kMillimetres = 1e3;

// The digits that a page shows: a frame is a third as long as with all digits.
double micro(double value) { return rounded(value, 1e6); }
double milli(double value) { return rounded(value, 1e3); }

void add_numbers(JsonWriter& out, std::string_view name, std::initializer_list<double> numbers) {
  out.name(name);
  out.array([&] {
    for (const double x : numbers) out.value(micro(x));
  });
}
void add_vector(JsonWriter& out, std::string_view name, const Eigen::Vector3d& v) {
  add_numbers(out, name, {v.x(), v.y(), v.z()});
}
void add_quaternion(JsonWriter& out, const Eigen::Quaterniond& q) {
  add_numbers(out, "q", {q.w(), q.x(), q.y(), q.z()});
}

void add_covariance(JsonWriter& out, const Eigen::Matrix3d& c) {
  out.name("cov");
  out.array([&] {
    for (int row = 0; row < 3; ++row)
      for (int column = row; column < 3; ++column) out.value(rounded(c(row, column), 1e12));
  });
}

double to_ms(Duration d) { return milli(to_seconds(d) * 1e3); }

/// An object with this `type`, and what `fill` adds to it.
template <class Fill>
std::string message(std::string_view type, Fill&& fill) {
  JsonWriter out;
  out.object([&] {
    out.member("type", type);
    fill(out);
  });
  return out.take();
}

void add_pose(JsonWriter& out, const BodyPose& body) {
  if (!had_pose(body)) {
    for (const char* name :
         {"p", "q", "v", "speed", "turn_rate_deg_s", "sigma_mm", "sigma_deg", "cov", "age_ms"}) {
      out.member(name, nullptr);
    }
    return;
  }
  add_vector(out, "p", body.X_WP.p);
  add_quaternion(out, body.X_WP.q);
  add_vector(out, "v", body.v_WP);
  out.member("speed", milli(body.v_WP.norm()));
  out.member("turn_rate_deg_s", milli(body.w_WP_P.norm() * kDegreesPerRadian));
  out.member("sigma_mm", milli(body.position_sigma_m() * kMillimetres));
  out.member("sigma_deg", milli(body.rotation_sigma_rad() * kDegreesPerRadian));
  add_covariance(out, body.covariance.topLeftCorner<3, 3>());
  out.member("age_ms", to_ms(body.age));
}

void add_body(JsonWriter& out, const BodyPose& body) {
  out.member("id", body.body_id);
  out.member("state", name_of(body.state));
  out.member("valid", body.valid);
  add_pose(out, body);
  out.member("latency_ms", to_ms(body.processing));
  out.member("tags", body.tags_in_view);
  out.member("image_rate_hz", milli(body.image_rate_hz));
  out.member("reprojection_px", milli(body.reprojection_px));
  out.member("images_dropped", body.images_dropped);
}

void add_tag(JsonWriter& out, const MapTag& entry) {
  const Eigen::Matrix3d position = entry.tag.covariance.topLeftCorner<3, 3>();
  out.member("id", entry.tag.tag_id);
  out.member("edge_m", micro(entry.tag.edge_m));
  out.member("state", name_of(entry.state));
  out.member("component", entry.component);
  out.member("sightings", entry.sightings);
  out.member("last_seen_utc_ms", entry.last_seen_utc_ns / 1'000'000);
  add_vector(out, "p", entry.tag.X_WT.p);
  add_quaternion(out, entry.tag.X_WT.q);
  out.member("sigma_mm", milli(std::sqrt(position.diagonal().maxCoeff()) * kMillimetres));
  add_covariance(out, position);
}

void add_client(JsonWriter& out, const ClientStatus& client) {
  out.member("protocol", client.protocol);
  out.member("peer", client.peer);
  out.member("detail", client.detail);
  out.member("sent", client.frames_sent);
  out.member("dropped", client.frames_dropped);
  out.member("connected_s", milli(client.connected_s));
  const double unknown = std::numeric_limits<double>::quiet_NaN();  // written as null
  out.member("clock_offset_s", client.clock ? client.clock->offset_s : unknown);
  out.member("clock_sigma_s", client.clock ? client.clock->sigma_s : unknown);
}

void add_event(JsonWriter& out, const Event& event) {
  out.member("n", event.number);
  out.member("utc_ms", event.utc_ms);
  out.member("severity", name_of(event.severity));
  out.member("subject", event.subject);
  out.member("kind", event.kind);
  out.member("text", event.text.substr(0, kLongestText));
  out.member("remedy", event.remedy.substr(0, kLongestText));
  out.member("over", event.over);
}

}  // namespace

void JsonWriter::begin_value() {
  if (needs_comma_) out_ += ',';
  needs_comma_ = true;
}

void JsonWriter::name(std::string_view name) {
  value(name);
  out_ += ':';
  needs_comma_ = false;
}

void JsonWriter::value(std::nullptr_t) {
  begin_value();
  out_ += "null";
}

void JsonWriter::value(bool truth) {
  begin_value();
  out_ += truth ? "true" : "false";
}

void JsonWriter::value(double number) {
  if (!std::isfinite(number)) return value(nullptr);
  begin_value();
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
  out_.append(text.data(), end);
}

void JsonWriter::value(std::string_view text) {
  // A single text is destroyed without an allocation.
  using Json = nlohmann::json;
  const std::string quoted = Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
  begin_value();
  out_ += quoted;
}

// Every pose of a filter has a covariance.
bool had_pose(const BodyPose& body) {
  return body.valid || body.covariance.diagonal().head<3>().maxCoeff() > 0;
}

std::string encode_ticket(std::string_view ticket) {
  return message("ticket", [&](JsonWriter& out) { out.member("ticket", ticket); });
}

std::string encode_hello(const Hello& hello, const SceneModel& model) {
  return message("hello", [&](JsonWriter& out) {
    out.member("server", "fiducapd");
    out.member("version", hello.version);
    out.member("map_mode", hello.map_mode);
    out.member("page_rate_hz", hello.rate_hz);
    out.member("takes_commands", hello.takes_commands);
    out.objects("bodies", model.bodies, [&](const auto& body) {
      out.member("id", body.id);
      out.member("name", body.name);
    });
  });
}

std::string encode_map(const TagMap& map) {
  return message("map", [&](JsonWriter& out) {
    out.member("version", map.version);
    out.member("parent", map.parent);
    out.member("hash", map.hash);
    out.member("family", map.family);
    out.member("reference_tag", map.reference_tag);
    out.member("comment", map.comment);
    out.objects("tags", map.tags, [&](const MapTag& entry) { add_tag(out, entry); });
  });
}

std::string encode_fits(std::span<const TagFit> fits, Duration utc_offset) {
  return message("fits", [&](JsonWriter& out) {
    out.objects("tags", fits, [&](const TagFit& fit) {
      out.member("id", fit.tag_id);
      out.member("px", milli(fit.rms_px));
      out.member("sightings", fit.sightings);
      out.member("last_seen_utc_ms", (to_ns(fit.seen_at) + utc_offset.count()) / 1'000'000);
    });
  });
}

std::string encode_versions(std::span<const MapVersionInfo> versions) {
  return message("versions", [&](JsonWriter& out) {
    out.objects("versions", versions, [&](const MapVersionInfo& one) {
      out.member("version", one.version);
      out.member("parent", one.parent);
      out.member("utc_ms", one.created_utc_ns / 1'000'000);
      out.member("tags", one.tags);
      out.member("comment", one.comment);
    });
  });
}

std::string encode_diff(const TagMap& before, const TagMap& after, const Pose& X_RW) {
  const auto add_place = [&](JsonWriter& out, const char* name, const MapTag* tag) {
    if (tag == nullptr) return out.member(name, nullptr);
    add_vector(out, name, X_RW * tag->tag.X_WT.p);
  };
  return message("diff", [&](JsonWriter& out) {
    out.member("before", before.version);
    out.member("after", after.version);
    out.objects("changes", diff(before, after), [&](const TagChange& change) {
      out.member("id", change.tag_id);
      out.member("kind", name_of(change.kind));
      out.member("mm", milli(change.distance_mm));
      out.member("deg", milli(change.angle_deg));
      add_place(out, "from", before.find(change.tag_id));
      add_place(out, "to", after.find(change.tag_id));
    });
  });
}

std::string encode_frame(const SceneFrame& frame) {
  return message("frame", [&](JsonWriter& out) {
    out.member("number", frame.number);
    out.member("utc_ms", frame.utc_ns() / 1'000'000);
    out.member("rate_hz", milli(frame.rate_hz));
    out.member("map_version", frame.map ? std::optional(frame.map->version) : std::nullopt);
    out.objects("bodies", frame.bodies, [&](const BodyPose& body) { add_body(out, body); });
  });
}

std::string encode_clients(std::span<const ClientStatus> clients) {
  return message("clients", [&](JsonWriter& out) {
    out.objects("clients", clients, [&](const ClientStatus& one) { add_client(out, one); });
  });
}

std::string encode_log(std::span<const log::Line> lines) {
  return message("log", [&](JsonWriter& out) {
    out.objects("lines", lines, [&](const log::Line& line) {
      out.member("n", line.number);
      out.member("utc_ms", line.utc_ms);
      out.member("level", log::name_of(line.level));
      out.member("module", line.module);
      out.member("text", line.text.substr(0, kLongestText));
    });
  });
}

std::string encode_events(std::span<const Event> standing, std::span<const Event> newest) {
  return message("events", [&](JsonWriter& out) {
    out.objects("standing", standing, [&](const Event& event) { add_event(out, event); });
    out.objects("events", newest, [&](const Event& event) { add_event(out, event); });
  });
}

std::string encode_state(const StateParts& parts) {
  std::string out = "{";
  const auto add = [&out](std::string_view name, std::string_view json) {
    if (out.size() > 1) out += ',';
    out.append("\"").append(name).append("\":").append(json.empty() ? "null" : json);
  };
  add("hello", parts.hello);
  add("map", parts.map);
  add("fits", parts.fits);
  add("frame", parts.frame);
  add("clients", parts.clients);
  add("log", parts.log);
  add("events", parts.events);
  return out += '}';
}

}  // namespace fiducap::web
