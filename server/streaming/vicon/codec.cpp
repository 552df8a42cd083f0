#include "streaming/vicon/codec.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/bytes.hpp"

namespace fiducap::vicon {

namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kSecondsPerDay = 86'400;
constexpr std::int64_t kTimecodeRate_hz = 25;
constexpr std::uint32_t kPal = 0;
constexpr std::int8_t kZUp = 0;

std::uint32_t u32(Type type) { return static_cast<std::uint32_t>(type); }
std::uint32_t u32(std::size_t n) { return static_cast<std::uint32_t>(n); }

LittleEndianWriter begin(Type type, std::size_t payload, std::vector<std::byte>& out) {
  LittleEndianWriter to(out);
  to.u32(u32(type)).u32(u32(payload));
  return to;
}

/// A per-subject object with one segment.
LittleEndianWriter begin_segment(Type type, std::size_t values, std::uint32_t subject,
                                 std::vector<std::byte>& out) {
  LittleEndianWriter to = begin(type, 12 + values, out);
  to.u32(subject).u32(1).u32(kSegment);
  return to;
}

void put_u32(std::uint32_t v, std::byte* at) {
  for (std::size_t i = 0; i < 4; ++i) at[i] = static_cast<std::byte>(v >> (8 * i));
}

void put(LittleEndianWriter& to, std::string_view text) { to.u32(u32(text.size())).text(text); }
void put(LittleEndianWriter& to, const Eigen::Vector3f& v) { to.f32(v.x()).f32(v.y()).f32(v.z()); }
void put(LittleEndianWriter& to, const Eigen::Matrix3d& R) {
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) to.f64(R(row, column));
}

/// A count of elements of `size` bytes, at most as many as bytes are left.
Expected<std::uint32_t> checked_count(LittleEndianReader& from, std::size_t size,
                                      const char* context) {
  const std::uint32_t n = from.u32();
  if (auto read = from.check(context); !read) return tl::unexpected(read.error());
  if (n > from.left() / size)
    return fail(ErrorCode::kTruncated,
                std::to_string(n) + " elements of " + std::to_string(size) + " bytes announced, " +
                    std::to_string(from.left()) + " bytes left",
                context);
  return n;
}

template <typename T>
Expected<T> checked(const LittleEndianReader& from, T value, const char* context) {
  if (auto read = from.check(context); !read) return tl::unexpected(read.error());
  return value;
}

}  // namespace

std::size_t open_packet(std::vector<std::byte>& out) {
  LittleEndianWriter(out).u32(kPacketTag).u32(0);
  return out.size();
}

void close_packet(std::size_t opened, std::vector<std::byte>& out) {
  put_u32(u32(out.size() - opened), out.data() + opened - 4);
}

void encode_greeting(std::vector<std::byte>& out) {
  const std::size_t opened = open_packet(out);
  LittleEndianWriter to = begin(Type::kObjectEnums, 4 + 4 * kOffered.size(), out);
  to.u32(u32(kOffered.size()));
  for (const Type type : kOffered) to.u32(u32(type));
  close_packet(opened, out);
}

void encode_pong(std::uint64_t id, std::vector<std::byte>& out) {
  const std::size_t opened = open_packet(out);
  begin(Type::kPing, 8, out).u64(id);
  close_packet(opened, out);
}

void encode_contents(std::span<const std::pair<Type, std::uint32_t>> counts,
                     std::span<const Type> unchanged, std::vector<std::byte>& out) {
  LittleEndianWriter to = begin(Type::kContents, 8 + 8 * counts.size() + 4 * unchanged.size(), out);
  to.u32(u32(counts.size()));
  for (const auto& [type, n] : counts) to.u32(u32(type)).u32(n);
  to.u32(u32(unchanged.size()));
  for (const Type type : unchanged) to.u32(u32(type));
}

void encode_application_info(std::vector<std::byte>& out) {
  begin(Type::kApplicationInfo, 1, out).u8(static_cast<std::uint8_t>(kZUp));
}

void encode_stream_info(double rate_hz, std::vector<std::byte>& out) {
  const std::int64_t period = std::llround(kTicksPerSecond / rate_hz);
  begin(Type::kStreamInfo, 8, out).i64(std::max<std::int64_t>(period, 1));
}

void encode_subject_info(std::uint32_t subject, std::string_view name,
                         std::vector<std::byte>& out) {
  constexpr std::size_t kBounds = 6 * 4;
  LittleEndianWriter to = begin(Type::kSubjectInfo, 56 + 2 * name.size(), out);
  to.u32(subject);
  put(to, name);
  to.u32(1).u32(kRootParent).u32(kSegment).zeros(kBounds);
  put(to, name);
  to.u32(0).u32(0);
}

void encode_subject_topology(std::uint32_t subject, std::vector<std::byte>& out) {
  LittleEndianWriter to = begin_segment(Type::kSubjectTopology, 96, subject, out);
  to.zeros(24);
  put(to, Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
}

void encode_subject_scale(std::uint32_t subject, std::vector<std::byte>& out) {
  begin_segment(Type::kSubjectScale, 24, subject, out).f64(1).f64(1).f64(1);
}

void encode_number(Type type, std::uint32_t number, std::vector<std::byte>& out) {
  begin(type, 4, out).u32(number);
}

void encode_object_quality(std::uint32_t subject, double quality, std::vector<std::byte>& out) {
  begin(Type::kObjectQuality, 12, out).u32(subject).f64(quality);
}

void encode_named(Type type, std::span<const NamedValue> values, std::vector<std::byte>& out) {
  std::size_t payload = 4;
  for (const auto& [name, value] : values) payload += 4 + name.size() + 8;
  LittleEndianWriter to = begin(type, payload, out);
  to.u32(u32(values.size()));
  for (const auto& [name, value] : values) {
    put(to, name);
    to.f64(value);
  }
}

Timecode timecode_of(std::int64_t utc_ns, double rate_hz) {
  std::int64_t ns_of_day = utc_ns % (kSecondsPerDay * kNsPerSecond);
  if (ns_of_day < 0) ns_of_day += kSecondsPerDay * kNsPerSecond;
  const std::int64_t second = ns_of_day / kNsPerSecond;
  const std::int64_t per_frame =
      std::max<std::int64_t>(std::llround(std::ceil(rate_hz / kTimecodeRate_hz)), 1);
  const std::int64_t subframe =
      ns_of_day % kNsPerSecond * kTimecodeRate_hz * per_frame / kNsPerSecond;
  Timecode time;
  time.hours = static_cast<std::uint8_t>(second / 3600);
  time.minutes = static_cast<std::uint8_t>(second / 60 % 60);
  time.seconds = static_cast<std::uint8_t>(second % 60);
  time.frames = static_cast<std::uint8_t>(subframe / per_frame);
  time.subframe = static_cast<std::uint16_t>(subframe % per_frame);
  time.subframes_per_frame = static_cast<std::uint16_t>(per_frame);
  return time;
}

void encode_timecode(const Timecode& time, std::vector<std::byte>& out) {
  begin(Type::kTimecode, 17, out)
      .u8(time.hours)
      .u8(time.minutes)
      .u8(time.seconds)
      .u8(time.frames)
      .u16(time.subframe)
      .u16(time.subframes_per_frame)
      .u32(kPal)
      .u32(0)  // user bits
      .u8(0);  // field flag
}

void encode_segments(Type type, const SegmentPose& pose, std::vector<std::byte>& out) {
  LittleEndianWriter to = begin_segment(type, 96, pose.subject, out);
  to.f64(pose.t_mm.x()).f64(pose.t_mm.y()).f64(pose.t_mm.z());
  put(to, pose.R);
}

void encode_lightweight_segments(const SegmentPose& pose, std::vector<std::byte>& out) {
  LittleEndianWriter to = begin_segment(Type::kLightweightSegments, 24, pose.subject, out);
  put(to, Eigen::Vector3f(pose.t_mm.cast<float>()));
  put(to, Eigen::Vector3f(pose.rotation_vector.cast<float>()));
}

Expected<std::size_t> packet_size(std::span<const std::byte> in) {
  for (std::size_t i = 0; i < std::min<std::size_t>(in.size(), 4); ++i) {
    if (in[i] == static_cast<std::byte>(kPacketTag >> (8 * i) & 0xff)) continue;
    return fail(ErrorCode::kInvalid, "expected the packet tag 01 00 2b 1a, got something else",
                "Vicon packet");
  }
  if (in.size() < kHeaderSize) return 0;
  LittleEndianReader from(in);
  from.u32();
  const std::size_t length = from.u32();
  if (length > kMaxClientPacket)
    return fail(ErrorCode::kInvalid,
                "expected a length up to " + std::to_string(kMaxClientPacket) + ", got " +
                    std::to_string(length),
                "Vicon packet");
  return kHeaderSize + length;
}

Expected<Object> take_object(std::span<const std::byte>& objects) {
  LittleEndianReader from(objects);
  Object object;
  object.type = from.u32();
  const std::size_t length = from.u32();
  if (!from.failed()) object.payload = from.bytes(length);
  if (auto read = from.check("Vicon object"); !read) return tl::unexpected(read.error());
  objects = objects.subspan(kHeaderSize + length);
  return object;
}

Expected<TypeSet> decode_object_enums(std::span<const std::byte> payload) {
  constexpr const char* kContext = "Vicon ObjectEnums";
  LittleEndianReader from(payload);
  const auto n = checked_count(from, 4, kContext);
  if (!n) return tl::unexpected(n.error());
  TypeSet types;
  for (std::uint32_t i = 0; i < *n; ++i) types.add(from.u32());
  return types;
}

Expected<bool> decode_request_frame(std::span<const std::byte> payload) {
  LittleEndianReader from(payload);
  return checked(from, from.u8() != 0, "Vicon RequestFrame");
}

Expected<std::uint32_t> decode_request_next_frame(std::span<const std::byte> payload) {
  LittleEndianReader from(payload);
  return checked(from, from.u32(), "Vicon RequestNextFrame");
}

Expected<std::uint64_t> decode_ping(std::span<const std::byte> payload) {
  LittleEndianReader from(payload);
  return checked(from, from.u64(), "Vicon Ping");
}

Expected<SubjectFilter> decode_filter(std::span<const std::byte> payload) {
  constexpr const char* kContext = "Vicon Filter";
  LittleEndianReader from(payload);
  const auto types = checked_count(from, 8, kContext);
  if (!types) return tl::unexpected(types.error());
  SubjectFilter filter;
  for (std::uint32_t i = 0; i < *types; ++i) {
    const std::uint32_t type = from.u32();
    const auto n = checked_count(from, 4, kContext);
    if (!n) return tl::unexpected(n.error());
    LittleEndianReader ids(from.bytes(4 * std::size_t{*n}));
    if (!index_of(type) || !is_per_subject(static_cast<Type>(type))) continue;
    auto& wanted = filter[static_cast<Type>(type)];
    while (ids.left() > 0) wanted.push_back(ids.u32());
  }
  // Once per type: one packet may name the same type thousands of times.
  for (auto& [type, wanted] : filter) {
    std::ranges::sort(wanted);
    wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  }
  return filter;
}

}  // namespace fiducap::vicon
