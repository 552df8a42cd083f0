#include "streaming/natnet/command_words.hpp"

#include <algorithm>
#include <array>
#include <charconv>

#include "streaming/natnet/properties.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::int32_t kDone = 0;
constexpr std::int32_t kRefused = 1;
constexpr std::int32_t kLive = 0;
constexpr std::int32_t kRecording = 1;
constexpr float kMillimetresPerUnit = 1000.0F;

// There is no player behind this server; it is always live.
constexpr std::array<std::string_view, 10> kAcceptedAndIgnored{
    "LiveMode",           "EditMode",           "TimelinePlay",         "TimelineStop",
    "SetPlaybackTakeName", "SetPlaybackStartFrame", "SetPlaybackStopFrame", "SetPlaybackCurrentFrame",
    "SetPlaybackLooping", "SetCurrentSession"};

std::optional<Datagram> fact(std::string_view word, const ServerView& server) {
  if (word == "FrameRate") return encode_response(static_cast<float>(server.rate_hz));
  if (word == "UnitsToMillimeters") return encode_response(kMillimetresPerUnit);
  if (word == "AnalogSamplesPerMocapFrame") return encode_response(std::int32_t{0});
  if (word == "CurrentTakeLength") return encode_response(std::int32_t{0});
  if (word == "CurrentSessionPath") return encode_text_response("/");
  if (word != "CurrentMode") return std::nullopt;
  return encode_response(server.desk != nullptr && server.desk->recording() ? kRecording : kLive);
}

CommandWords::Answer bitstream(const Command& command, const CommandWords::Asker& asker) {
  if (command.count == 0) return {encode_bitstream_response(asker.version)};
  const auto wanted = parse_bitstream(command[0]);
  // Multicast frames are one for all; a client that gets none has nothing to switch.
  if (asker.multicast || !wanted || !is_supported(*wanted)) return {encode_response(kRefused)};
  return {encode_response(kDone), wanted};
}

std::optional<int> body_id(std::string_view node, bool by_id, const ServerView& server) {
  if (!by_id) {
    const auto body = find_body(server, node);
    return body ? std::optional(body->id) : std::nullopt;
  }
  int id = 0;
  const auto [end, error] = std::from_chars(node.data(), node.data() + node.size(), id);
  const auto& bodies = server.model->bodies;
  const bool ours = error == std::errc{} && end == node.data() + node.size() &&
                    std::any_of(bodies.begin(), bodies.end(), [&](const auto& body) { return body.id == id; });
  return ours ? std::optional(id) : std::nullopt;
}

/// `SubscribeToData[,type[,name[,None]]]`, `SubscribeByID[,RigidBody,id[,None]]`. Of other types we have nothing.
std::int32_t subscribe(const Command& command, bool by_id, const ServerView& server, Selection& selection) {
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

std::optional<std::int32_t> select(const Command& command, const ServerView& server, const CommandWords::Asker& asker) {
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
  // Of takes we know the one being recorded, and of that its name.
  const auto name = server.desk == nullptr ? std::nullopt : server.desk->recording();
  if (command[1] != "Name" || !name || (!command[0].empty() && command[0] != *name)) return std::nullopt;
  return encode_text_response(*name);
}

}  // namespace

CommandWords::Answer CommandWords::answer(std::string_view text, const ServerView& server, const Asker& asker) {
  const Command command = parse_command(text);
  if (auto known = fact(command.word, server)) return {std::move(*known)};
  if (command.word == "Bitstream") return bitstream(command, asker);
  if (command.word == "Disconnect") return {encode_response(kDone), std::nullopt, true};
  if (const auto done = select(command, server, asker)) return {encode_response(*done)};
  if (std::find(kAcceptedAndIgnored.begin(), kAcceptedAndIgnored.end(), command.word) != kAcceptedAndIgnored.end()) {
    return {encode_response(kDone)};
  }
  if (command.word == "GetProperty") {
    const auto value = get_property(command, server);
    return {value ? encode_text_response(*value) : encode_unrecognized()};
  }
  if (command.word == "GetTakeProperty") return {take_property(command, server).value_or(encode_unrecognized())};
  if (auto done = operator_words_.answer(command, server, asker.peer)) return {std::move(*done)};
  return {encode_unrecognized()};
}

}  // namespace fiducap::natnet
