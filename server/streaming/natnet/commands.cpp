#include "streaming/natnet/commands.hpp"

#include <algorithm>
#include <array>
#include <sstream>

#include "base/log.hpp"
#include "base/text.hpp"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap::natnet {

namespace {

std::vector<OperatorApi::Body> all_bodies(const ServerView& server) {
  if (server.operator_api != nullptr) return server.operator_api->bodies();
  std::vector<OperatorApi::Body> bodies;
  for (const auto& body : server.model->bodies)
    bodies.push_back({body.id, body.name, true, Pose{}});
  return bodies;
}

/// `Master Rate`, `master_rate` → `masterrate`
std::string plain(std::string_view name) {
  std::string out;
  for (const char c : name) {
    if (c != ' ' && c != '_' && c != '-') out += lower(c);
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
  return std::ranges::any_of(
      bodies, [&](const BodyPose& body) { return body.body_id == id && body.valid; });
}

std::string name_for_clients(const OperatorApi::Body& body, const ServerView& server) {
  for (const auto& shown : server.announced)
    if (shown.id == body.id) return shown.name;
  return client_name(body.name, kNames, server.config.aliases);  // disabled
}

/// @param node  name for clients, our own name, or streaming id; also of disabled bodies
std::optional<OperatorApi::Body> find_body(const ServerView& server, std::string_view node) {
  const auto bodies = all_bodies(server);
  const auto with = [&](const auto& holds) -> std::optional<OperatorApi::Body> {
    const auto at = std::ranges::find_if(bodies, holds);
    if (at == bodies.end()) return std::nullopt;
    return *at;
  };
  for (const auto& shown : server.announced)
    if (shown.name == node) return with([&](const auto& body) { return body.id == shown.id; });
  if (const auto own = with([&](const auto& body) { return body.name == node; })) return own;
  if (const auto hidden = with([&](const auto& body) {
        return client_name(body.name, kNames, server.config.aliases) == node;
      })) {
    return hidden;
  }
  const auto id = whole_number<int>(node);
  return id ? with([&](const auto& body) { return body.id == *id; }) : std::nullopt;
}

std::optional<std::string> body_property(const OperatorApi::Body& body, const std::string& name,
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

/// @return nullopt: no such node or property
std::optional<std::string> get_property(const Command& command, const ServerView& server) {
  const bool has_node = command.count >= 2 && !command[0].empty();
  const std::string name = plain(command.count >= 2 ? command[1] : command[0]);
  if (!has_node) return server_property(name, server);
  const auto body = find_body(server, command[0]);
  return body ? body_property(*body, name, server) : std::nullopt;
}

constexpr std::int32_t kDone = 0;
constexpr std::int32_t kRefused = 1;
constexpr std::size_t kMaxTakeName = 128;
constexpr std::size_t kLongestNode = 60;  // in the log

Expected<OperatorApi::Body> body_of(const Command& command, const ServerView& server) {
  if (auto body = find_body(server, command[0])) return *body;
  return fail(ErrorCode::kNotFound, "no body of this name or id");
}

constexpr std::int32_t kLive = 0;
constexpr std::int32_t kRecording = 1;
constexpr float kMillimetresPerUnit = 1000.0F;

// There is no playback; the server is always live.
constexpr std::array<std::string_view, 10> kAcceptedAndIgnored{
    "LiveMode",
    "EditMode",
    "TimelinePlay",
    "TimelineStop",
    "SetPlaybackTakeName",
    "SetPlaybackStartFrame",
    "SetPlaybackStopFrame",
    "SetPlaybackCurrentFrame",
    "SetPlaybackLooping",
    "SetCurrentSession",
};

std::optional<Datagram> fact(std::string_view word, const ServerView& server) {
  if (word == "FrameRate") return encode_response(static_cast<float>(server.rate_hz));
  if (word == "UnitsToMillimeters") return encode_response(kMillimetresPerUnit);
  if (word == "AnalogSamplesPerMocapFrame") return encode_response(std::int32_t{0});
  if (word == "CurrentTakeLength") return encode_response(std::int32_t{0});
  if (word == "CurrentSessionPath") return encode_text_response("/");
  if (word != "CurrentMode") return std::nullopt;
  return encode_response(
      server.operator_api != nullptr && server.operator_api->recording() ? kRecording : kLive);
}

CommandWords::Answer bitstream(const Command& command, const CommandWords::Asker& asker) {
  if (command.count == 0) return {encode_bitstream_response(asker.version)};
  const auto wanted = parse_bitstream(command[0]);
  // Multicast frames are the same for all clients.
  if (asker.multicast || !wanted || !is_supported(*wanted)) return {encode_response(kRefused)};
  return {encode_response(kDone), wanted};
}

std::optional<int> body_id(std::string_view node, bool by_id, const ServerView& server) {
  if (!by_id) {
    const auto body = find_body(server, node);
    return body ? std::optional(body->id) : std::nullopt;
  }
  const auto id = whole_number<int>(node);
  const auto& bodies = server.model->bodies;
  const bool is_known =
      id && std::ranges::any_of(bodies, [&](const auto& b) { return b.id == *id; });
  return is_known ? id : std::nullopt;
}

/// `SubscribeToData[,type[,name[,None]]]`, `SubscribeByID[,RigidBody,id[,None]]`.
std::int32_t subscribe(const Command& command, bool by_id, const ServerView& server,
                       Selection& selection) {
  const std::string_view type = command[0];
  const std::string_view node = command[1];
  if (command.count == 0) {
    selection.clear();
    return kDone;
  }
  const bool wanted = command[2] != "None" && node != "None";
  const bool all = node.empty() || node == "all" || node == "All" || node == "None";
  if (type == "AllTypes") selection.all_types(wanted);
  if (type == "RigidBody" && all) selection.rigid_bodies(wanted);
  if (type != "RigidBody" || all) return kDone;
  const auto id = body_id(node, by_id, server);
  if (!id) return kRefused;
  selection.body(*id, wanted);
  return kDone;
}

std::optional<std::int32_t> select(const Command& command, const ServerView& server,
                                   const CommandWords::Asker& asker) {
  const bool by_id = command.word == "SubscribeByID";
  const bool only = command.word == "SubscribedDataOnly";
  if (command.word != "SubscribeToData" && !by_id && !only) return std::nullopt;
  if (asker.subscriber == nullptr) return kRefused;
  Selection& selection = asker.subscriber->selection;
  if (!only) return subscribe(command, by_id, server, selection);
  selection.only_subscribed();
  return kDone;
}

std::optional<Datagram> take_property(const Command& command, const ServerView& server) {
  // Only the running recording is known, by its name.
  const auto name =
      server.operator_api == nullptr ? std::nullopt : server.operator_api->recording();
  if (command[1] != "Name" || !name || (!command[0].empty() && command[0] != *name))
    return std::nullopt;
  return encode_text_response(*name);
}

Expected<void> start_recording(const Command&, const ServerView& server, const Requester& by,
                               std::string& next_take) {
  auto started = server.operator_api->start_recording(by, next_take);
  if (started) next_take.clear();  // a name is used once
  return started;
}

Expected<void> stop_recording(const Command&, const ServerView& server, const Requester& by,
                              std::string&) {
  return server.operator_api->stop_recording(by);
}

Expected<void> set_take_name(const Command& command, const ServerView&, const Requester&,
                             std::string& next_take) {
  if (command[0].empty() || command[0].size() > kMaxTakeName)
    return fail(ErrorCode::kInvalid, "a take's name has 1 to 128 bytes");
  next_take = command[0];
  return {};
}

template <bool kEnabled>
Expected<void> set_enabled(const Command& command, const ServerView& server, const Requester& by,
                           std::string&) {
  const auto body = body_of(command, server);
  if (!body) return tl::unexpected(body.error());
  return server.operator_api->set_enabled(by, body->id, kEnabled);
}

Expected<void> reset_orientation(const Command& command, const ServerView& server,
                                 const Requester& by, std::string&) {
  const auto body = body_of(command, server);
  if (!body) return tl::unexpected(body.error());
  const BodyPose* now = nullptr;
  if (server.frame) {
    for (const BodyPose& pose : server.frame->bodies)
      if (pose.body_id == body->id && pose.valid) now = &pose;
  }
  if (now == nullptr)
    return fail(ErrorCode::kUnavailable, "the body is not tracked: its attitude is unknown");
  // Rotates the pivot so that the body's present attitude becomes the identity: q_WP q_PP' = 1.
  return server.operator_api->set_pivot(by, body->id,
                                        {body->X_BP.q * now->X_WP.q.conjugate(), body->X_BP.p});
}

Expected<void> reset_location(const Command& command, const ServerView& server, const Requester& by,
                              std::string&) {
  const auto body = body_of(command, server);
  if (!body) return tl::unexpected(body.error());
  return server.operator_api->set_pivot(by, body->id, {body->X_BP.q, Eigen::Vector3d::Zero()});
}

Expected<void> recalibrate(const Command&, const ServerView&, const Requester&, std::string&) {
  return fail(ErrorCode::kUnsupported, "has no meaning for a body that sees tags");
}

Expected<void> set_property(const Command& command, const ServerView& server, const Requester& by,
                            std::string&) {
  if (command.count < 3 || command[0].empty())
    return fail(ErrorCode::kUnsupported,
                "the server's own properties are set in its configuration");
  const auto body = body_of(command, server);
  if (!body) return tl::unexpected(body.error());
  const std::string name = plain(command[1]);
  if (name == "name") return server.operator_api->rename(by, body->id, std::string(command[2]));
  if (!is_active(name))
    return fail(ErrorCode::kUnsupported, "only Name and Active of a body can be set");
  const auto wanted = read_bool(command[2]);
  if (!wanted) return fail(ErrorCode::kInvalid, "Active is true or false");
  return server.operator_api->set_enabled(by, body->id, *wanted);
}

struct OperatorCommand {
  std::string_view word;
  Expected<void> (*run)(const Command&, const ServerView&, const Requester&,
                        std::string& next_take);
};
constexpr std::array<OperatorCommand, 9> kOperatorCommands{{
    {"StartRecording", start_recording},
    {"StopRecording", stop_recording},
    {"SetRecordTakeName", set_take_name},
    {"EnableAsset", set_enabled<true>},
    {"DisableAsset", set_enabled<false>},
    {"ResetAssetOrientation", reset_orientation},
    {"ResetAssetLocation", reset_location},
    {"RecalibrateAsset", recalibrate},
    {"SetProperty", set_property},
}};

/// The protocol has no password.
bool may_change(const ServerView& server, const Peer& from) {
  const RemoteControl allowed = server.config.remote_control;
  return server.operator_api != nullptr &&
         (allowed == RemoteControl::kAll ||
          (allowed == RemoteControl::kLoopback && from.is_loopback()));
}

/// @return nullopt: not one of these commands
std::optional<Datagram> run_operator_command(const Command& command, const ServerView& server,
                                             const Peer& from, std::string& next_take) {
  const auto at = std::ranges::find_if(
      kOperatorCommands, [&](const auto& known) { return known.word == command.word; });
  if (at == kOperatorCommands.end()) return std::nullopt;
  if (!may_change(server, from)) {
    if (server.operator_api != nullptr)
      server.operator_api->note_refusal(
          {"natnet", {}, text_of(from)},
          std::string(at->word) + " " + std::string(command[0].substr(0, kLongestNode)),
          "streaming.natnet.remote_control does not allow it");
    return encode_response(kRefused);
  }
  const Requester by{"natnet", "remote_control", text_of(from)};
  const auto done = at->run(command, server, by, next_take);
  if (!done)
    log::info("natnet",
              std::string(at->word) + " of " + by.address + " is refused: " + done.error().text());
  return encode_response(done ? kDone : kRefused);
}

}  // namespace

CommandWords::Answer CommandWords::answer(std::string_view text, const ServerView& server,
                                          const Asker& asker) {
  const Command command = parse_command(text);
  if (auto known = fact(command.word, server)) return {std::move(*known)};
  if (command.word == "Bitstream") return bitstream(command, asker);
  if (command.word == "Disconnect") return {encode_response(kDone), std::nullopt, true};
  if (const auto done = select(command, server, asker)) return {encode_response(*done)};
  if (std::find(kAcceptedAndIgnored.begin(), kAcceptedAndIgnored.end(), command.word) !=
      kAcceptedAndIgnored.end()) {
    return {encode_response(kDone)};
  }
  if (command.word == "GetProperty") {
    const auto value = get_property(command, server);
    return {value ? encode_text_response(*value) : encode_unrecognized()};
  }
  if (command.word == "GetTakeProperty")
    return {take_property(command, server).value_or(encode_unrecognized())};
  if (auto done = run_operator_command(command, server, asker.peer, next_take_))
    return {std::move(*done)};
  return {encode_unrecognized()};
}

}  // namespace fiducap::natnet
