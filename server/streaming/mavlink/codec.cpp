#include "streaming/mavlink/codec.hpp"

#include <algorithm>

#include "base/byte_reader.hpp"
#include "base/byte_writer.hpp"

namespace fiducap::mavlink {

namespace {

// Name, types and order of a message's fields, folded into one byte by the protocol's rule: both
// sides mean the same.
std::optional<std::uint8_t> checksum_seed(std::uint32_t message) {
  switch (static_cast<MessageId>(message)) {
    case MessageId::kHeartbeat:
      return 50;
    case MessageId::kVisionPositionEstimate:
      return 158;
    case MessageId::kTimesync:
      return 34;
    case MessageId::kOdometry:
      return 91;
  }
  return std::nullopt;
}

/// CRC-16/MCRF4XX, a byte at a time.
class Checksum final {
 public:
  void add(std::uint8_t byte) {
    auto folded = static_cast<std::uint8_t>(byte ^ (value_ & 0xff));
    folded = static_cast<std::uint8_t>(folded ^ (folded << 4));
    value_ =
        static_cast<std::uint16_t>((value_ >> 8) ^ (folded << 8) ^ (folded << 3) ^ (folded >> 4));
  }
  void add(std::span<const std::byte> bytes) {
    for (const std::byte byte : bytes) add(static_cast<std::uint8_t>(byte));
  }
  [[nodiscard]] std::uint16_t value() const { return value_; }

 private:
  std::uint16_t value_{0xffff};
};

/// Header, then the fields by `write`, then what depends on them: length without trailing zeros,
/// checksum.
template <typename Write>
void frame(const Sender& from, MessageId message, std::vector<std::byte>& out, Write&& write) {
  const std::size_t start = out.size();
  const auto id = static_cast<std::uint32_t>(message);
  LittleEndianWriter to(out);
  to.u8(kMagic2).u8(0).u8(0).u8(0).u8(from.sequence).u8(from.system).u8(from.component);
  to.u16(static_cast<std::uint16_t>(id)).u8(static_cast<std::uint8_t>(id >> 16));
  write(to);
  while (out.size() > start + kHeader2 + 1 && out.back() == std::byte{0}) out.pop_back();
  out[start + 1] = static_cast<std::byte>(out.size() - start - kHeader2);
  Checksum sum;
  sum.add(std::span(out).subspan(start + 1));
  sum.add(*checksum_seed(id));
  to.u16(sum.value());
}

void put(LittleEndianWriter& to, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) to.f32(static_cast<float>(v[i]));
}

/// Upper right triangle, row by row.
void put(LittleEndianWriter& to, const Matrix6d& covariance) {
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column)
      to.f32(static_cast<float>(covariance(row, column)));
  }
}

std::uint8_t u8(std::span<const std::byte> bytes, std::size_t at) {
  return static_cast<std::uint8_t>(bytes[at]);
}

struct Shape {
  std::size_t header{};
  std::size_t payload{};
  std::size_t whole{};  ///< With checksum and signature.
  std::uint32_t message{};
  std::uint8_t system{};
  std::uint8_t component{};
};

/// @return nullopt: no frame begins here, or it is cut off
std::optional<Shape> shape_of(std::span<const std::byte> in) {
  if (in.size() < kHeader1) return std::nullopt;
  const std::size_t payload = u8(in, 1);
  Shape shape;
  if (u8(in, 0) == kMagic1) {
    shape = {kHeader1, payload, kHeader1 + payload + kChecksum, u8(in, 5), u8(in, 3), u8(in, 4)};
  } else if (u8(in, 0) == kMagic2 && in.size() >= kHeader2) {
    const std::uint8_t incompatible = u8(in, 2);
    if ((incompatible & ~kSigned) != 0) return std::nullopt;  // means something that we do not know
    const std::size_t signature = (incompatible & kSigned) != 0 ? kSignature : 0;
    const std::uint32_t message =
        u8(in, 7) | std::uint32_t{u8(in, 8)} << 8 | std::uint32_t{u8(in, 9)} << 16;
    shape = {kHeader2, payload,   kHeader2 + payload + kChecksum + signature,
             message,  u8(in, 5), u8(in, 6)};
  } else {
    return std::nullopt;
  }
  if (in.size() < shape.whole) return std::nullopt;
  return shape;
}

bool is_intact(std::span<const std::byte> in, const Shape& shape, std::uint8_t seed) {
  Checksum sum;
  sum.add(in.subspan(1, shape.header - 1 + shape.payload));
  sum.add(seed);
  const std::size_t at = shape.header + shape.payload;
  return u8(in, at) == (sum.value() & 0xff) && u8(in, at + 1) == sum.value() >> 8;
}

/// The payload with the zeros that were not sent.
template <std::size_t N>
std::array<std::byte, N> whole_payload(const Frame& frame) {
  std::array<std::byte, N> payload{};
  std::copy_n(frame.payload.begin(), std::min(N, frame.payload.size()), payload.begin());
  return payload;
}

}  // namespace

void encode_heartbeat(const Sender& from, const Heartbeat& heartbeat, std::vector<std::byte>& out) {
  frame(from, MessageId::kHeartbeat, out, [&](LittleEndianWriter& to) {
    to.u32(0)
        .u8(heartbeat.type)
        .u8(heartbeat.autopilot)
        .u8(0)
        .u8(heartbeat.system_status)
        .u8(kProtocolVersion);
  });
}

void encode_timesync(const Sender& from, const Timesync& timesync, std::vector<std::byte>& out) {
  frame(from, MessageId::kTimesync, out,
        [&](LittleEndianWriter& to) { to.i64(timesync.tc1_ns).i64(timesync.ts1_ns); });
}

void encode_odometry(const Sender& from, const PoseReport& report, std::vector<std::byte>& out) {
  const AutopilotOdometry& odometry = report.odometry;
  frame(from, MessageId::kOdometry, out, [&](LittleEndianWriter& to) {
    to.u64(report.time_us);
    put(to, odometry.p_NF);
    const Eigen::Quaterniond& q = odometry.q_NF;
    for (const double part : {q.w(), q.x(), q.y(), q.z()}) to.f32(static_cast<float>(part));
    put(to, odometry.v_NF_F);
    put(to, odometry.w_NF_F);
    put(to, odometry.pose_covariance);
    put(to, odometry.twist_covariance);
    to.u8(report.world == AutopilotWorld::kNed ? kFrameLocalNed : kFrameLocalFrd).u8(kFrameBodyFrd);
    to.u8(report.reset_counter).u8(kEstimatorMocap).u8(static_cast<std::uint8_t>(report.quality));
  });
}

void encode_vision_position(const Sender& from, const PoseReport& report,
                            std::vector<std::byte>& out) {
  frame(from, MessageId::kVisionPositionEstimate, out, [&](LittleEndianWriter& to) {
    to.u64(report.time_us);
    put(to, report.odometry.p_NF);
    put(to, roll_pitch_yaw(report.odometry.q_NF));
    put(to, report.odometry.pose_covariance);
    to.u8(report.reset_counter);
  });
}

std::optional<Frame> next_frame(std::span<const std::byte>& in) {
  while (!in.empty()) {
    const auto shape = shape_of(in);
    if (!shape) {
      in = in.subspan(1);
      continue;
    }
    const auto seed = checksum_seed(shape->message);
    const auto bytes = in;
    if (seed && !is_intact(bytes, *shape, *seed)) {
      in = in.subspan(1);
      continue;
    }
    in = in.subspan(shape->whole);
    if (!seed) continue;  // not for us; its length has to be believed
    return Frame{shape->message, shape->system, shape->component,
                 bytes.subspan(shape->header, shape->payload)};
  }
  return std::nullopt;
}

Timesync decode_timesync(const Frame& frame) {
  const auto payload = whole_payload<16>(frame);
  LittleEndianReader from(payload);
  Timesync timesync;
  timesync.tc1_ns = from.i64();
  timesync.ts1_ns = from.i64();
  return timesync;
}

Heartbeat decode_heartbeat(const Frame& frame) {
  const auto payload = whole_payload<9>(frame);
  return {u8(payload, 4), u8(payload, 5), u8(payload, 7)};
}

}  // namespace fiducap::mavlink
