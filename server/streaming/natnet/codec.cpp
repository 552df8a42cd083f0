#include "streaming/natnet/codec.hpp"

#include <algorithm>

#include "base/bytes.hpp"
#include "base/text.hpp"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::size_t kMostParts = 4;

/// The newest that is not newer than `version`; the oldest for anything before it.
Bitstream round_down(Bitstream version) {
  const auto above = std::upper_bound(kBitstreams.begin(), kBitstreams.end(), version);
  return above == kBitstreams.begin() ? kOldest : *(above - 1);
}

// Sender block: char name[256], u8 application version[4], u8 library version[4]; then, from 4.x
// on, the options: u8 subscribed data only, u8 wanted bitstream[4].
constexpr std::size_t kSenderName = 256;
constexpr std::size_t kSenderBlock = 264;
constexpr std::size_t kSenderWithOptions = 269;
constexpr std::size_t kShownName = 64;

struct Sender {
  std::string name;
  ClientVersions versions;
  bool subscribed_data_only{};
};

Bitstream read_version(LittleEndianReader& in) {
  const Bitstream version{in.u8(), in.u8()};
  in.bytes(2);  // revision and build do not change the layout
  return version;
}

/// @return only a name ("Ping") when the payload has no sender block
Sender read_sender(std::span<const std::byte> payload) {
  Sender sender;
  sender.name =
      printable(until_zero(payload.first(std::min(payload.size(), kSenderName))), kShownName);
  if (payload.size() < kSenderBlock) return sender;
  LittleEndianReader in(payload.subspan(kSenderName));
  in.bytes(4);  // version of the client's application
  sender.versions.library = read_version(in);
  if (payload.size() < kSenderWithOptions) return sender;
  sender.subscribed_data_only = in.u8() != 0;
  sender.versions.wanted = read_version(in);
  return sender;
}

constexpr std::string_view kApplication = "Fiducap";
constexpr std::size_t kNameField = 256;
constexpr std::uint16_t kServerInfoSize = 279;
constexpr std::uint16_t kServerInfoSize2 = 264;  // before 3.0: no clock, no data port

LittleEndianWriter begin(Datagram& out, Message message, std::size_t payload) {
  out.reserve(kHeaderSize + payload);
  LittleEndianWriter writer(out);
  writer.u16(static_cast<std::uint16_t>(message)).u16(static_cast<std::uint16_t>(payload));
  return writer;
}

constexpr std::int32_t kRigidBody = 1;
constexpr std::int32_t kNoParent = -1;
constexpr std::size_t kOffset = 3 * sizeof(float);
constexpr std::size_t kQuaternion = 4 * sizeof(float);
constexpr std::size_t kCount = sizeof(std::int32_t);

/// Bytes of one description after its type and size words.
std::size_t body_size(const std::string& name, ModelLayout layout) {
  std::size_t size = name.size() + 1 + sizeof(std::int32_t) + sizeof(kNoParent) + kOffset;
  if (layout >= ModelLayout::k4_2) size += kQuaternion;
  if (layout >= ModelLayout::k3_0) size += kCount;  // of markers
  return size;
}

std::size_t packet_size(std::span<const BodyDescription> bodies, ModelLayout layout) {
  std::size_t size = kCount;
  for (const auto& body : bodies)
    size += sizeof(kRigidBody) + (layout >= ModelLayout::k4_1 ? kCount : 0) +
            body_size(body.name, layout);
  return size;
}

void write_body(const BodyDescription& body, ModelLayout layout, LittleEndianWriter& out) {
  out.i32(kRigidBody);
  if (layout >= ModelLayout::k4_1) out.i32(static_cast<std::int32_t>(body_size(body.name, layout)));
  out.text(body.name).u8(0).i32(body.id).i32(kNoParent).zeros(kOffset);
  if (layout >= ModelLayout::k4_2) out.f32(0).f32(0).f32(0).f32(1);
  if (layout >= ModelLayout::k3_0) out.i32(0);  // markers
}

std::vector<BodyDescription> with_names(const SceneModel& model,
                                        const std::vector<std::string>& names) {
  std::vector<BodyDescription> bodies;
  for (std::size_t i = 0; i < names.size(); ++i) bodies.push_back({model.bodies[i].id, names[i]});
  return bodies;
}

}  // namespace

std::string text_of(Bitstream version) {
  return std::to_string(version.major) + "." + std::to_string(version.minor);
}

std::optional<Bitstream> parse_bitstream(std::string_view text) {
  std::array<std::uint8_t, kMostParts> parts{};
  for (std::size_t n = 0; n < kMostParts; ++n) {
    const auto dot = text.find('.');
    const auto part = whole_number<std::uint8_t>(text.substr(0, dot));
    if (!part) return std::nullopt;
    parts[n] = *part;
    if (dot == std::string_view::npos)
      return n > 0 ? std::optional(Bitstream{parts[0], parts[1]}) : std::nullopt;
    text.remove_prefix(dot + 1);
  }
  return std::nullopt;
}

bool is_supported(Bitstream version) {
  return std::find(kBitstreams.begin(), kBitstreams.end(), version) != kBitstreams.end();
}

Bitstream negotiate(const ClientVersions& client, Bitstream server_default) {
  if (client.wanted && *client.wanted != Bitstream{}) return round_down(*client.wanted);
  if (client.library && *client.library >= kGetsItsOwn) return round_down(*client.library);
  // A library cannot read newer versions than its own: it crashes.
  if (client.library && client.library->major >= kOldest.major)
    return round_down(std::min(server_default, *client.library));
  return round_down(server_default);
}

FrameLayout frame_layout(Bitstream version) {
  if (version >= Bitstream{4, 1}) return FrameLayout::k4_1;
  if (version >= Bitstream{3, 0}) return FrameLayout::k3_0;
  if (version >= Bitstream{2, 9}) return FrameLayout::k2_9;
  if (version >= Bitstream{2, 7}) return FrameLayout::k2_7;
  if (version >= Bitstream{2, 6}) return FrameLayout::k2_6;
  return FrameLayout::k2_5;
}

ModelLayout model_layout(Bitstream version) {
  if (version >= Bitstream{4, 2}) return ModelLayout::k4_2;
  if (version >= Bitstream{4, 1}) return ModelLayout::k4_1;
  if (version >= Bitstream{4, 0}) return ModelLayout::k4_0;
  if (version >= Bitstream{3, 0}) return ModelLayout::k3_0;
  return ModelLayout::k2_5;
}

std::optional<Request> decode_request(std::span<const std::byte> datagram) {
  LittleEndianReader header(datagram);
  const auto message = static_cast<Message>(header.u16());
  const std::size_t announced = header.u16();
  if (header.failed()) return std::nullopt;
  const auto rest = datagram.subspan(kHeaderSize);
  const auto payload = rest.first(std::min(announced, rest.size()));
  LittleEndianReader in(payload);
  switch (message) {
    case Message::kConnect: {
      Sender sender = read_sender(payload);
      return ConnectRequest{std::move(sender.name), sender.versions, sender.subscribed_data_only,
                            payload.empty()};
    }
    case Message::kDiscovery:
      return DiscoveryRequest{read_sender(payload).versions};
    case Message::kKeepAlive: {
      Sender sender = read_sender(payload);
      return KeepAliveRequest{std::move(sender.name), sender.versions};
    }
    case Message::kDisconnect:
      return DisconnectRequest{};
    case Message::kEchoRequest: {
      const EchoRequest echo{in.u64()};
      return in.failed() ? std::nullopt : std::optional<Request>(echo);
    }
    case Message::kRequestModel: {
      const ModelRequest model{in.u32()};
      return in.failed() ? ModelRequest{} : model;  // none, or one NUL: all types
    }
    case Message::kRequestFrame:
      return FrameRequest{};
    case Message::kRequest:
      return CommandRequest{until_zero(payload)};
    default:
      return std::nullopt;
  }
}

Command parse_command(std::string_view text) {
  Command command;
  auto comma = text.find(',');
  command.word = trimmed(text.substr(0, comma));
  while (comma != std::string_view::npos && command.count < Command::kMostArguments) {
    text.remove_prefix(comma + 1);
    comma = command.count + 1 < Command::kMostArguments ? text.find(',') : std::string_view::npos;
    command.arguments[command.count++] = trimmed(text.substr(0, comma));
  }
  return command;
}

Datagram encode(const ServerInfo& info) {
  const bool is_2 = info.bitstream.major < 3;
  Datagram out;
  auto writer = begin(out, Message::kServerInfo, is_2 ? kServerInfoSize2 : kServerInfoSize);
  writer.text(kApplication).zeros(kNameField - kApplication.size());
  for (const auto part : info.application_version) writer.u8(part);
  writer.u8(info.bitstream.major).u8(info.bitstream.minor).u8(0).u8(0);
  if (is_2) return out;
  writer.u64(kClockFrequency).u16(info.data_port).u8(info.is_multicast ? 1 : 0);
  for (const auto octet : info.group) writer.u8(octet);
  return out;
}

Datagram encode_echo(std::uint64_t client_ticks, Instant received_at) {
  Datagram out;
  begin(out, Message::kEchoResponse, 16).u64(client_ticks).i64(ticks(received_at));
  return out;
}

Datagram encode_response(std::int32_t value) {
  Datagram out;
  begin(out, Message::kResponse, 4).i32(value);
  return out;
}

Datagram encode_response(float value) {
  Datagram out;
  begin(out, Message::kResponse, 4).f32(value);
  return out;
}

Datagram encode_text_response(std::string_view text) {
  const auto shown = text.substr(0, kMaxText - 1);
  Datagram out;
  begin(out, Message::kResponse, shown.size() + 1).text(shown).u8(0);
  return out;
}

Datagram encode_bitstream_response(Bitstream version) {
  const std::string text = "Bitstream," + text_of(version) + ".0";
  Datagram out;
  begin(out, Message::kResponse, text.size()).text(text);
  return out;
}

Datagram encode_unrecognized() {
  Datagram out;
  begin(out, Message::kUnrecognized, 0);
  return out;
}

std::vector<BodyDescription> announced_bodies(const SceneModel& model, const NameRule& rule,
                                              const NameAliases& aliases) {
  SceneModel shown{model.generation, model.bodies};
  if (shown.bodies.size() > kMaxBodies) shown.bodies.resize(kMaxBodies);
  NameRule fit = rule;
  fit.max_bytes = std::min(rule.max_bytes, kMaxName);
  auto bodies = with_names(shown, client_names(shown, fit, aliases));
  if (packet_size(bodies, ModelLayout::k4_2) <= kMaxPayload) return bodies;
  const std::size_t bare = packet_size(
      with_names(shown, std::vector<std::string>(shown.bodies.size())), ModelLayout::k4_2);
  fit.max_bytes = (kMaxPayload - bare) / shown.bodies.size();
  return with_names(shown, client_names(shown, fit, aliases));
}

std::vector<std::byte> encode_model(std::span<const BodyDescription> bodies, ModelLayout layout,
                                    std::uint32_t types) {
  if ((types & ModelRequest::kRigidBodies) == 0) bodies = {};
  const std::size_t payload = packet_size(bodies, layout);
  FIDUCAP_ASSERT(payload <= kMaxPayload);
  std::vector<std::byte> bytes;
  auto out = begin(bytes, Message::kModel, payload);
  out.i32(static_cast<std::int32_t>(bodies.size()));
  for (const auto& body : bodies) write_body(body, layout, out);
  FIDUCAP_ASSERT(bytes.size() == kHeaderSize + payload);
  return bytes;
}

}  // namespace fiducap::natnet
