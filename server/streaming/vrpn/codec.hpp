#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "streaming/vrpn/protocol.hpp"

/// VRPN messages to bytes and back. Pure; everything is big-endian. Encoders append to the caller's
/// vector, so that a reused one allocates nothing. Positions and attitudes are already in the
/// client's axes and metres (streaming/conventions/axes.hpp).
namespace fiducap::vrpn {

/// What stands before every payload, apart from its length.
struct Header {
  std::int64_t utc_ns{};  ///< On the wire: seconds and microseconds since 1970, unsigned.
  std::int32_t sender{};
  std::int32_t type{};
  std::uint32_t sequence{};

  friend bool operator==(const Header&, const Header&) = default;
};

/// One framed message as it lies in the caller's buffer.
struct Message {
  Header header;
  std::span<const std::byte> payload;  ///< Without padding.
  std::size_t size{};  ///< Bytes occupied, padding included: the next message starts there.
};

struct Cookie {
  int minor{};
  int log_mode{};  ///< 0..3; the wish to log is not granted.
};

struct TextMessage {
  Severity severity{};
  std::uint32_t level{};
  std::string_view text;
};

/// `vrpn: ver. 07.<minor>`, log mode 0, five zero bytes; raw, before any framed message.
void encode_cookie(int minor, std::vector<std::byte>& out);
/// `-1` or `-2` with the described id in the sender field: uint32 n, n bytes of name with its zero.
void encode_description(const Header& header, std::string_view name, std::vector<std::byte>& out);
/// No payload: pong.
void encode_empty(const Header& header, std::vector<std::byte>& out);
/// 64 bytes: 0 int32 sensor · 4 int32 sensor again · 8 float64 position[3] · 32 float64
/// quaternion[4], x y z w.
void encode_pos_quat(const Header& header, int sensor, const Pose& X, std::vector<std::byte>& out);
/// 72 bytes, velocity and acceleration alike: 0 int32 sensor · 4 int32 sensor again · 8 float64
/// vector[3] · 32 float64 quaternion[4], x y z w: the turn that happens within dt · 64 float64 dt,
/// seconds.
void encode_rate(const Header& header, int sensor, const Eigen::Vector3d& rate,
                 const Eigen::Quaterniond& turn, double dt_s, std::vector<std::byte>& out);
/// 56 bytes: float64 position[3] · float64 quaternion[4], x y z w.
void encode_to_room(const Header& header, const Pose& X, std::vector<std::byte>& out);
/// 64 bytes: int32 sensor · int32 0 · float64 position[3] · float64 quaternion[4], x y z w.
void encode_unit_to_sensor(const Header& header, int sensor, const Pose& X,
                           std::vector<std::byte>& out);
/// 48 bytes: float64 min[3] · float64 max[3], metres.
void encode_workspace(const Header& header, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                      std::vector<std::byte>& out);
/// uint32 severity · uint32 level · text, zero. Longer texts are cut at 1023 bytes.
void encode_text(const Header& header, const TextMessage& message, std::vector<std::byte>& out);

/// Gives the messages of `bytes` consecutive sequence numbers; each connection counts on its own.
/// @pre `bytes` holds whole messages made by the encoders above.
void number_messages(std::span<std::byte> bytes, std::uint32_t& next);

/// @return bytes the first message of `in` occupies, 0 while its length field is incomplete; Error
/// when that length
///         is below 24 or its payload above 64000 bytes.
[[nodiscard]] Expected<std::size_t> occupied_size(std::span<const std::byte> in);
/// @return the first message of `in`; `kTruncated` when it is not complete.
[[nodiscard]] Expected<Message> decode_message(std::span<const std::byte> in);

/// Any minor version and any bytes after the log mode are accepted; another major version is
/// `kUnsupported`.
[[nodiscard]] Expected<Cookie> decode_cookie(std::span<const std::byte> in);
/// The name in a description: up to its zero or the end; the length before it is wrong in some
/// clients and not used.
[[nodiscard]] Expected<std::string_view> decode_name(std::span<const std::byte> payload);
/// @return the port in a UDP description (it travels in the sender field); its address is checked
/// for form only.
[[nodiscard]] Expected<std::uint16_t> decode_udp_description(const Message& message);
[[nodiscard]] Expected<TextMessage> decode_text(std::span<const std::byte> payload);
/// A connection request, `"127.0.0.1 32997\0"`. @return the port to connect to, 1024 or more.
[[nodiscard]] Expected<std::uint16_t> decode_request(std::span<const std::byte> datagram);

}  // namespace fiducap::vrpn
