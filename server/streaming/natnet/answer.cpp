#include "streaming/natnet/answer.hpp"

#include <algorithm>
#include <string>

#include "base/assert.hpp"
#include "base/byte_writer.hpp"
#include "streaming/natnet/request.hpp"
#include "streaming/natnet/wire.hpp"

namespace fiducap::natnet {

namespace {

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
  for (const auto& body : bodies) {
    size += sizeof(kRigidBody) + (layout >= ModelLayout::k4_1 ? kCount : 0) +
            body_size(body.name, layout);
  }
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
  bytes.reserve(kHeaderSize + payload);
  LittleEndianWriter out(bytes);
  out.u16(static_cast<std::uint16_t>(Message::kModel)).u16(static_cast<std::uint16_t>(payload));
  out.i32(static_cast<std::int32_t>(bodies.size()));
  for (const auto& body : bodies) write_body(body, layout, out);
  FIDUCAP_ASSERT(bytes.size() == kHeaderSize + payload);
  return bytes;
}

}  // namespace fiducap::natnet
