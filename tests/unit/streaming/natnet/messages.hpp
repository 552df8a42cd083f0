#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.hpp"
#include "streaming/natnet/codec.hpp"

/// Messages of clients, and how they read the replies.
namespace fiducap::natnet {

using Bytes = std::vector<std::byte>;

inline Bytes message(Message id, std::span<const std::byte> payload = {}) {
  const auto low = [](std::size_t value) { return static_cast<std::byte>(value & 0xff); };
  const auto number = static_cast<std::size_t>(id);
  Bytes out{low(number), low(number >> 8), low(payload.size()), low(payload.size() >> 8)};
  out.resize(kHeaderSize + payload.size());
  std::copy(payload.begin(), payload.end(), out.begin() + kHeaderSize);
  return out;
}

/// @return text and its terminator. Memory is reserved because GCC 12 warns without reason else.
inline Bytes text_payload(std::string_view text) {
  constexpr std::size_t kLongestPayload = 300;
  Bytes payload;
  payload.reserve(kLongestPayload);
  LittleEndianWriter(payload).text(text).u8(0);
  return payload;
}

inline Bytes words(std::string_view text) { return message(Message::kRequest, text_payload(text)); }

/// 264 bytes, as a 3.x library sends them.
inline Bytes sender_block(Bitstream library, std::string_view name = "NatNetLib") {
  Bytes payload = text_payload(name);
  LittleEndianWriter out(payload);
  out.zeros(256 - payload.size()).zeros(4).u8(library.major).u8(library.minor).zeros(2);
  return payload;
}

inline Bytes connect(Bitstream library) {
  return message(Message::kConnect, sender_block(library));
}

/// 269 bytes, as a 4.x library sends them.
inline Bytes connect(Bitstream library, Bitstream wanted, bool subscribed_data_only = false) {
  Bytes payload = sender_block(library);
  LittleEndianWriter out(payload);
  out.u8(subscribed_data_only ? 1 : 0).u8(wanted.major).u8(wanted.minor).zeros(2);
  return message(Message::kConnect, payload);
}

inline Bytes ping() { return message(Message::kConnect, text_payload("Ping")); }

inline Message id_of(std::span<const std::byte> datagram) {
  return static_cast<Message>(LittleEndianReader(datagram).u16());
}

/// The payload of a RESPONSE as text or number.
inline std::string text_in(std::span<const std::byte> datagram) {
  if (datagram.size() < kHeaderSize) return {};
  const std::string all(reinterpret_cast<const char*>(datagram.data()) + kHeaderSize,
                        datagram.size() - kHeaderSize);
  return all.substr(0, all.find('\0'));
}
inline std::int32_t number_in(std::span<const std::byte> datagram) {
  LittleEndianReader in(datagram);
  in.bytes(kHeaderSize);
  const std::int32_t number = in.i32();
  return in.failed() || in.left() != 0 ? -1 : number;
}

/// Of SERVERINFO.
inline Bitstream version_in(std::span<const std::byte> info) {
  return {std::to_integer<std::uint8_t>(info[4 + 260]),
          std::to_integer<std::uint8_t>(info[4 + 261])};
}

/// Frame params: before the four bytes that end every frame since 2.6.
inline int bits_in(std::span<const std::byte> frame) {
  LittleEndianReader in(frame.subspan(frame.size() - 6));
  return in.i16();
}

/// Bodies of a frame in 3.0 to 4.0 layout, without marker sets.
struct WireBody {
  int id{};
  float p[3]{};
  float q[4]{};
  float mean_error{};
  int params{};
};
inline std::vector<WireBody> bodies_in(std::span<const std::byte> frame) {
  LittleEndianReader in(frame);
  in.bytes(kHeaderSize + 4 + 8);
  std::vector<WireBody> bodies(static_cast<std::size_t>(std::clamp(in.i32(), 0, 2000)));
  for (auto& body : bodies) {
    body.id = in.i32();
    for (float& x : body.p) x = in.f32();
    for (float& x : body.q) x = in.f32();
    body.mean_error = in.f32();
    body.params = in.i16();
  }
  return bodies;
}

}  // namespace fiducap::natnet
