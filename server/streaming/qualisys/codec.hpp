#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "streaming/conventions/text_fields.hpp"
#include "streaming/qualisys/protocol.hpp"

/// QTM packets (except data packets, see frame_board.hpp) and commands, to bytes and back. Pure.
/// Encoders append to the caller's vector.
namespace fiducap::qualisys {

/// One packet in the caller's buffer.
struct Packet {
  PacketType type{};
  std::span<const std::byte> payload;
  std::size_t size{};  ///< Bytes occupied; the next packet starts there.
};

/// kError, kCommand, kXml: the text and its zero.
void encode_text(std::endian order, PacketType type, std::string_view text,
                 std::vector<std::byte>& out);
void encode_event(std::endian order, Event event, std::vector<std::byte>& out);
/// There is no frame.
void encode_no_more_data(std::endian order, std::vector<std::byte>& out);

/// The first packet of a TCP stream.
/// @return nullopt while it is incomplete; Error for a size below 8 or above kMaxIncoming
[[nodiscard]] Expected<std::optional<Packet>> decode_packet(std::endian order,
                                                            std::span<const std::byte> bytes);
/// The text of a command or settings packet: up to the first zero, which may be missing.
[[nodiscard]] std::string_view decode_text(std::span<const std::byte> payload);

/// Discovery request: u32 10, u32 7, in either byte order, u16 port in network order.
/// @return the port for the reply; nullopt: another datagram
[[nodiscard]] std::optional<std::uint16_t> decode_discover(std::span<const std::byte> datagram);
/// Its reply, always little-endian: type 1, `about` and its zero, u16 base port in network order.
void encode_discover_answer(std::string_view about, std::uint16_t base_port,
                            std::vector<std::byte>& out);

/// A command, split; older SDKs send several spaces between words.
struct Command {
  std::string_view name;
  std::string_view rest;  ///< All that follows, trimmed.
  [[nodiscard]] bool is(std::string_view word) const { return same_word(name, word); }
};

[[nodiscard]] Command split_command(std::string_view text);
[[nodiscard]] std::vector<std::string_view> words_of(std::string_view text);

enum class RateKind { kAllFrames, kFrequency, kFrequencyDivisor };

/// Rate of one client's stream.
struct Rate {
  RateKind kind{RateKind::kAllFrames};
  std::uint32_t n{1};  ///< Hz, or every n-th frame.
  friend bool operator==(const Rate&, const Rate&) = default;
};

/// `StreamFrames …`, except Stop.
struct StreamRequest {
  Rate rate;
  std::optional<std::uint16_t> udp_port;  ///< nullopt: by TCP.
  std::string udp_address;                ///< Empty: the client's.
  Components components;
};

/// @param words  after `StreamFrames`
/// @return nullopt without a rate or a known component, or for an invalid number
[[nodiscard]] std::optional<StreamRequest> parse_stream_request(std::string_view words);
/// @return nullopt when no word is a component
[[nodiscard]] std::optional<Components> parse_components(std::string_view words);
/// `1.N`   @return nullopt: not supported
[[nodiscard]] std::optional<Version> parse_version(std::string_view word);

/// The groups of `GetParameters`.
struct ParameterGroups {
  bool general{false};
  bool three_d{false};
  bool six_d{false};
  bool others{false};  ///< Known groups that are not supported, and left out.
  [[nodiscard]] bool any() const { return general || three_d || six_d || others; }
};
/// @return nullopt when no word is a group
[[nodiscard]] std::optional<ParameterGroups> parse_parameter_groups(std::string_view words);

}  // namespace fiducap::qualisys
