#include "streaming/natnet/answer.hpp"

#include "base/byte_writer.hpp"
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

}  // namespace fiducap::natnet
