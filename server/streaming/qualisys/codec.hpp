#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "streaming/qualisys/protocol.hpp"

/// QTM packets to bytes and back, all but data packets (frame_encoder.hpp). Pure. Encoders append
/// to the caller's vector.
namespace fiducap::qualisys {

/// One packet as it lies in the caller's buffer.
struct Packet {
  PacketType type{};
  std::span<const std::byte> payload;
  std::size_t size{};  ///< Bytes occupied; the next packet starts there.
};

/// kError, kCommand, kXml: the text and its zero.
void encode_text(std::endian order, PacketType type, std::string_view text,
                 std::vector<std::byte>& out);
void encode_event(std::endian order, Event event, std::vector<std::byte>& out);
/// "There is nothing to send."
void encode_no_more_data(std::endian order, std::vector<std::byte>& out);

/// The packet at the front of what came by TCP.
/// @return nothing while it is incomplete; Error when the size cannot be (below 8, above
///         kMaxIncoming): the stream is lost.
[[nodiscard]] Expected<std::optional<Packet>> decode_packet(std::endian order,
                                                            std::span<const std::byte> bytes);
/// The text of a command or settings packet: up to the first zero, which may be missing.
[[nodiscard]] std::string_view decode_text(std::span<const std::byte> payload);

/// A broadcast question "who is there": u32 10, u32 7, in either byte order, u16 port in network
/// order.
/// @return the port for the answer
[[nodiscard]] Expected<std::uint16_t> decode_discover(std::span<const std::byte> datagram);
/// Its answer, always little-endian: type 1, `about` and its zero, u16 base port in network order.
void encode_discover_answer(std::string_view about, std::uint16_t base_port,
                            std::vector<std::byte>& out);

}  // namespace fiducap::qualisys
