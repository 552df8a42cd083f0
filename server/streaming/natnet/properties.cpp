#include "streaming/natnet/properties.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>

namespace fiducap::natnet {

namespace {

/// `Master Rate`, `master_rate` → `masterrate`
std::string plain(std::string_view name) {
  std::string out;
  for (const char c : name) {
    if (c != ' ' && c != '_' && c != '-')
      out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return out;
}

bool is_one_of(const std::string& name, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string text_of(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string text_of(bool value) { return value ? "true" : "false"; }

std::optional<bool> read_bool(std::string_view text) {
  const std::string word = plain(text);
  if (is_one_of(word, {"true", "1", "yes", "on"})) return true;
  if (is_one_of(word, {"false", "0", "no", "off"})) return false;
  return std::nullopt;
}

bool is_active(const std::string& name) { return is_one_of(name, {"active", "enabled", "enable"}); }

bool is_tracked(int id, const ServerView& server) {
  if (!server.frame) return false;
  const auto& bodies = server.frame->bodies;
  return std::any_of(bodies.begin(), bodies.end(),
                     [&](const BodyPose& body) { return body.body_id == id && body.valid; });
}

std::string name_for_clients(const OperatorDesk::Body& body, const ServerView& server) {
  for (const auto& shown : server.announced) {
    if (shown.id == body.id) return shown.name;
  }
  return client_name(body.name, server.config.name_rule(), server.config.aliases);  // switched off
}

std::optional<std::string> body_property(const OperatorDesk::Body& body, const std::string& name,
                                         const ServerView& server) {
  if (name == "name") return name_for_clients(body, server);
  if (is_active(name)) return text_of(body.enabled);
  if (is_one_of(name, {"streamingid", "assetid", "id", "userdata"})) return std::to_string(body.id);
  if (is_one_of(name, {"trackingvalid", "tracked"})) return text_of(is_tracked(body.id, server));
  return std::nullopt;
}

std::optional<std::string> server_property(const std::string& name, const ServerView& server) {
  const NatNetConfig& config = server.config;
  if (is_one_of(name, {"framerate", "masterrate", "camerarate", "rate"}))
    return text_of(server.rate_hz);
  if (name == "upaxis") return config.up == UpAxis::kY ? "Y Axis" : "Z Axis";
  if (name == "units") return "Meters";
  if (is_one_of(name, {"bitstream", "bitstreamversion", "natnetversion"})) return config.bitstream;
  if (is_one_of(name, {"name", "application"})) return "Fiducap";
  if (name == "dataport") return std::to_string(config.data_port);
  if (name == "commandport") return std::to_string(config.port);
  if (is_one_of(name, {"multicastaddress", "multicastinterface", "multicastgroup"}))
    return config.multicast_group;
  if (name == "transmissiontype") return config.multicast ? "Multicast" : "Unicast";
  return std::nullopt;
}

}  // namespace

std::optional<std::string> get_property(const Command& command, const ServerView& server) {
  const bool has_node = command.count >= 2 && !command[0].empty();
  const std::string name = plain(command.count >= 2 ? command[1] : command[0]);
  if (!has_node) return server_property(name, server);
  const auto body = find_body(server, command[0]);
  return body ? body_property(*body, name, server) : std::nullopt;
}

Expected<void> set_property(const Command& command, const ServerView& server) {
  if (command.count < 3 || command[0].empty()) {
    return fail(ErrorCode::kUnsupported,
                "the server's own properties are set in its configuration");
  }
  const auto body = find_body(server, command[0]);
  if (!body) return fail(ErrorCode::kNotFound, "no body of this name or id");
  const std::string name = plain(command[1]);
  if (name == "name") return server.desk->rename(body->id, std::string(command[2]));
  if (!is_active(name))
    return fail(ErrorCode::kUnsupported, "only Name and Active of a body can be set");
  const auto wanted = read_bool(command[2]);
  if (!wanted) return fail(ErrorCode::kInvalid, "Active is true or false");
  return server.desk->set_enabled(body->id, *wanted);
}

}  // namespace fiducap::natnet
