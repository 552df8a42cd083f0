#include "middleware/mavlink/frame.hpp"

#include <utility>

#include "base/expected.hpp"

namespace fiducap::mavlink {

namespace {

// CRC_EXTRA: a hash of the names, types and order of a message's fields.
constexpr std::array<std::pair<MessageId, std::uint8_t>, 12> kChecksumSeeds{{
    {MessageId::kHeartbeat, 50},
    {MessageId::kScaledImu, 170},
    {MessageId::kRawImu, 144},
    {MessageId::kRequestDataStream, 148},
    {MessageId::kCommandLong, 152},
    {MessageId::kCommandAck, 143},
    {MessageId::kVisionPositionEstimate, 158},
    {MessageId::kHighresImu, 93},
    {MessageId::kTimesync, 34},
    {MessageId::kScaledImu2, 76},
    {MessageId::kScaledImu3, 46},
    {MessageId::kOdometry, 91},
}};

std::optional<std::uint8_t> checksum_seed(std::uint32_t message) {
  for (const auto& [id, seed] : kChecksumSeeds)
    if (static_cast<std::uint32_t>(id) == message) return seed;
  return std::nullopt;
}

/// CRC-16/MCRF4XX.
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

std::uint8_t u8(std::span<const std::byte> bytes, std::size_t at) {
  return static_cast<std::uint8_t>(bytes[at]);
}

struct Shape {
  std::size_t header{};
  std::size_t payload{};
  std::size_t whole{};  ///< With checksum and signature; 0: the header is cut off.
  std::uint32_t message{};
  std::uint8_t system{};
  std::uint8_t component{};
};

/// @pre not empty   @return nullopt: no frame begins here
std::optional<Shape> shape_of(std::span<const std::byte> in) {
  const std::uint8_t magic = u8(in, 0);
  if (magic != kMagic1 && magic != kMagic2) return std::nullopt;
  const std::size_t header = magic == kMagic1 ? kHeader1 : kHeader2;
  // Unknown incompatibility flags.
  if (magic == kMagic2 && in.size() > 2 && (u8(in, 2) & ~kSigned) != 0) return std::nullopt;
  if (in.size() < header) return Shape{};
  const std::size_t payload = u8(in, 1);
  if (magic == kMagic1)
    return Shape{header, payload, header + payload + kChecksum, u8(in, 5), u8(in, 3), u8(in, 4)};
  const std::size_t signature = (u8(in, 2) & kSigned) != 0 ? kSignature : 0;
  const std::uint32_t message =
      u8(in, 7) | std::uint32_t{u8(in, 8)} << 8 | std::uint32_t{u8(in, 9)} << 16;
  return Shape{header,  payload,   header + payload + kChecksum + signature,
               message, u8(in, 5), u8(in, 6)};
}

bool is_intact(std::span<const std::byte> in, const Shape& shape, std::uint8_t seed) {
  Checksum sum;
  sum.add(in.subspan(1, shape.header - 1 + shape.payload));
  sum.add(seed);
  const std::size_t at = shape.header + shape.payload;
  return u8(in, at) == (sum.value() & 0xff) && u8(in, at + 1) == sum.value() >> 8;
}

// In noise, a frame begins directly after another one once in 128 times.
constexpr int kCredibleRun = 4;

enum class Step { kFrame, kOther, kNoise, kCutOff };

/// Removes a frame or noise from the front of `in`; nothing when the frame is cut off.
Step step(std::span<const std::byte>& in, Frame& frame, std::uint64_t& broken) {
  const auto shape = shape_of(in);
  if (shape && (shape->whole == 0 || in.size() < shape->whole)) return Step::kCutOff;
  const auto seed = shape ? checksum_seed(shape->message) : std::nullopt;
  const auto bytes = in;
  const bool is_wrong = seed && !is_intact(bytes, *shape, *seed);
  broken += is_wrong ? 1 : 0;
  if (!shape || is_wrong) {
    in = in.subspan(1);
    return Step::kNoise;
  }
  in = in.subspan(shape->whole);
  if (!seed) return Step::kOther;  // unknown message: its length cannot be tested
  frame = {shape->message, shape->system, shape->component,
           bytes.subspan(shape->header, shape->payload)};
  return Step::kFrame;
}

}  // namespace

void begin_frame(const Sender& from, MessageId message, std::vector<std::byte>& out) {
  const auto id = static_cast<std::uint32_t>(message);
  LittleEndianWriter to(out);
  to.u8(kMagic2).u8(0).u8(0).u8(0).u8(from.sequence).u8(from.system).u8(from.component);
  to.u16(static_cast<std::uint16_t>(id)).u8(static_cast<std::uint8_t>(id >> 16));
}

/// Writes the length without trailing zeros, and the checksum.
void end_frame(std::size_t start, MessageId message, std::vector<std::byte>& out) {
  while (out.size() > start + kHeader2 + 1 && out.back() == std::byte{0}) out.pop_back();
  out[start + 1] = static_cast<std::byte>(out.size() - start - kHeader2);
  Checksum sum;
  sum.add(std::span(out).subspan(start + 1));
  sum.add(*checksum_seed(static_cast<std::uint32_t>(message)));
  LittleEndianWriter(out).u16(sum.value());
}

std::optional<Frame> next_frame(std::span<const std::byte>& in) {
  Frame frame;
  std::uint64_t broken = 0;
  while (!in.empty()) {
    const Step taken = step(in, frame, broken);
    if (taken == Step::kFrame) return frame;
    if (taken == Step::kCutOff) in = in.subspan(1);  // nothing more comes
  }
  return std::nullopt;
}

std::size_t FrameStream::keep(std::span<const std::byte> piece) {
  // A cut-off frame is shorter than kMaxFrame: moved to the front it leaves room.
  if (begin_ > 0) {
    std::ranges::copy(std::span(buffer_).subspan(begin_, end_ - begin_), buffer_.begin());
    end_ -= begin_;
    begin_ = 0;
  }
  const std::size_t taken = std::min(piece.size(), buffer_.size() - end_);
  FIDUCAP_ASSERT(taken > 0);
  std::copy_n(piece.begin(), taken, buffer_.begin() + static_cast<std::ptrdiff_t>(end_));
  end_ += taken;
  return taken;
}

std::optional<Frame> FrameStream::next() {
  Frame frame;
  while (begin_ < end_) {
    auto in = std::span<const std::byte>(buffer_).subspan(begin_, end_ - begin_);
    const Step taken = step(in, frame, broken_);
    begin_ = end_ - in.size();
    if (taken == Step::kCutOff) return std::nullopt;
    in_a_row_ = taken == Step::kNoise ? 0 : std::min(in_a_row_ + 1, kCredibleRun);
    if (taken == Step::kOther && in_a_row_ == kCredibleRun) ++others_;
    if (taken != Step::kFrame) continue;
    ++frames_;
    return frame;
  }
  return std::nullopt;
}

void encode_heartbeat(const Sender& from, const Heartbeat& heartbeat, std::vector<std::byte>& out) {
  append_frame(from, MessageId::kHeartbeat, out, [&](LittleEndianWriter& to) {
    to.u32(0)
        .u8(heartbeat.type)
        .u8(heartbeat.autopilot)
        .u8(0)
        .u8(heartbeat.system_status)
        .u8(kProtocolVersion);
  });
}

void encode_timesync(const Sender& from, const Timesync& timesync, std::vector<std::byte>& out) {
  append_frame(from, MessageId::kTimesync, out,
               [&](LittleEndianWriter& to) { to.i64(timesync.tc1_ns).i64(timesync.ts1_ns); });
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
  LittleEndianReader from(payload);
  from.u32();  // custom mode
  Heartbeat heartbeat;
  heartbeat.type = from.u8();
  heartbeat.autopilot = from.u8();
  from.u8();  // base mode
  heartbeat.system_status = from.u8();
  return heartbeat;
}

}  // namespace fiducap::mavlink
