#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "streaming/vicon/protocol.hpp"

/// Vicon DataStream packets and objects to bytes and back. Pure; little-endian, packed. Encoders
/// append whole objects to the caller's vector, so that a reused one allocates nothing. Lengths are
/// millimetres in the client's axes (z up); R rotates segment vectors into world vectors.
namespace fiducap::vicon {

/// Opens a packet; close_packet writes its length. @return what close_packet needs
[[nodiscard]] std::size_t open_packet(std::vector<std::byte>& out);
void close_packet(std::size_t opened, std::vector<std::byte>& out);

/// A whole packet, the server's first one: all types that it sends.
void encode_greeting(std::vector<std::byte>& out);
/// A whole packet: the reply to a ping, with its id.
void encode_pong(std::uint64_t id, std::vector<std::byte>& out);

/// map<u32 type, u32 objects in this packet> · set<u32 type> unchanged; both ascend by type.
void encode_contents(std::span<const std::pair<Type, std::uint32_t>> counts,
                     std::span<const Type> unchanged, std::vector<std::byte>& out);

/// i8: 0, z up.
void encode_application_info(std::vector<std::byte>& out);
/// i64 period of a frame in ticks of 135 MHz. @pre rate_hz > 0
void encode_stream_info(double rate_hz, std::vector<std::byte>& out);
/// u32 subject · str name · one root segment of the same name · no markers and attachments.
void encode_subject_info(std::uint32_t subject, std::string_view name, std::vector<std::byte>& out);
/// u32 subject · one segment: f64[3] zero, f64[9] identity.
void encode_subject_topology(std::uint32_t subject, std::vector<std::byte>& out);
/// u32 subject · one segment: f64[3] one.
void encode_subject_scale(std::uint32_t subject, std::vector<std::byte>& out);

/// u32. @param type  frame info (clients report it plus one) or hardware frame info
void encode_number(Type type, std::uint32_t number, std::vector<std::byte>& out);
/// u32 subject · f64 quality, 0 bad, 1 excellent.
void encode_object_quality(std::uint32_t subject, double quality, std::vector<std::byte>& out);

using NamedValue = std::pair<std::string_view, double>;
/// vec<{str name, f64}>, names ascending. @param type  latency info (s) or frame rate info (Hz)
void encode_named(Type type, std::span<const NamedValue> values, std::vector<std::byte>& out);

/// A time of day at 25 frames per second (EBU/PAL), each frame divided into `subframes_per_frame`.
struct Timecode {
  std::uint8_t hours{};
  std::uint8_t minutes{};
  std::uint8_t seconds{};
  std::uint8_t frames{};
  std::uint16_t subframe{};
  std::uint16_t subframes_per_frame{1};

  friend bool operator==(const Timecode&, const Timecode&) = default;
};
/// The UTC time of day. @param rate_hz  of the stream; each frame gets its own subframe
[[nodiscard]] Timecode timecode_of(std::int64_t utc_ns, double rate_hz);
void encode_timecode(const Timecode& time, std::vector<std::byte>& out);

/// Pose of a subject's segment. It is a root: global and local pose are equal.
struct SegmentPose {
  std::uint32_t subject{};
  Eigen::Vector3d t_mm{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d R{Eigen::Matrix3d::Identity()};
  Eigen::Vector3d rotation_vector{Eigen::Vector3d::Zero()};  ///< Of R, length at most pi.
};
/// u32 subject · one segment: f64[3] t, f64[9] R by rows. @param type  global or local segments
void encode_segments(Type type, const SegmentPose& pose, std::vector<std::byte>& out);
/// u32 subject · one segment: f32[3] t, f32[3] rotation vector.
void encode_lightweight_segments(const SegmentPose& pose, std::vector<std::byte>& out);

/// One object of a client's packet, in the caller's buffer.
struct Object {
  std::uint32_t type{};
  std::span<const std::byte> payload;
};

/// @return bytes that the first packet of `in` occupies, header included; 0 while its header is
/// incomplete; Error for a wrong tag, also an incomplete one, and a length above kMaxClientPacket.
[[nodiscard]] Expected<std::size_t> packet_size(std::span<const std::byte> in);
/// Removes the first object of a packet's content. @pre objects is not empty
[[nodiscard]] Expected<Object> take_object(std::span<const std::byte>& objects);

/// set<u32>; types that are not offered are ignored.
[[nodiscard]] Expected<TypeSet> decode_object_enums(std::span<const std::byte> payload);
/// bool: true: push every frame from now on; false: one frame.
[[nodiscard]] Expected<bool> decode_request_frame(std::span<const std::byte> payload);
/// u32: number of next frames.
[[nodiscard]] Expected<std::uint32_t> decode_request_next_frame(std::span<const std::byte> payload);
[[nodiscard]] Expected<std::uint64_t> decode_ping(std::span<const std::byte> payload);
/// map<u32 type, set<u32 subject>>; other types than offered per-subject ones are ignored.
[[nodiscard]] Expected<SubjectFilter> decode_filter(std::span<const std::byte> payload);

}  // namespace fiducap::vicon
