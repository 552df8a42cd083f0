#include "middleware/mavlink/frame.hpp"

#include "base/assert.hpp"

namespace fiducap::mavlink {

namespace {

// Name, types and order of a message's fields, folded into one byte by the protocol's rule: both
// sides mean the same.
std::optional<std::uint8_t> checksum_seed(std::uint32_t message) {
  switch (static_cast<MessageId>(message)) {
    case MessageId::kHeartbeat:
      return 50;
    case MessageId::kScaledImu:
      return 170;
    case MessageId::kRawImu:
      return 144;
    case MessageId::kRequestDataStream:
      return 148;
    case MessageId::kCommandLong:
      return 152;
    case MessageId::kCommandAck:
      return 143;
    case MessageId::kVisionPositionEstimate:
      return 158;
    case MessageId::kHighresImu:
      return 93;
    case MessageId::kTimesync:
      return 34;
    case MessageId::kScaledImu2:
      return 76;
    case MessageId::kScaledImu3:
      return 46;
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
  // Means something that we do not know.
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

// In noise a frame begins where another one ended once in 128 times.
constexpr int kBelieved = 4;

enum class Step { kFrame, kOther, kNoise, kCutOff };

/// One step through `in`: a frame, or something passed over, or what may become a frame.
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
  if (!seed) return Step::kOther;  // not for us; its length has to be believed
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

/// What depends on the fields: length without trailing zeros, checksum.
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
  // A frame that is cut off is shorter than kMaxFrame: there is room once it stands in front.
  if (begin_ > 0) {
    std::copy(waiting_.begin() + static_cast<std::ptrdiff_t>(begin_),
              waiting_.begin() + static_cast<std::ptrdiff_t>(end_), waiting_.begin());
    end_ -= begin_;
    begin_ = 0;
  }
  const std::size_t taken = std::min(piece.size(), waiting_.size() - end_);
  FIDUCAP_ASSERT(taken > 0);
  std::copy_n(piece.begin(), taken, waiting_.begin() + static_cast<std::ptrdiff_t>(end_));
  end_ += taken;
  return taken;
}

std::optional<Frame> FrameStream::next() {
  Frame frame;
  while (begin_ < end_) {
    auto in = std::span<const std::byte>(waiting_).subspan(begin_, end_ - begin_);
    const Step taken = step(in, frame, broken_);
    begin_ = end_ - in.size();
    if (taken == Step::kCutOff) return std::nullopt;
    in_a_row_ = taken == Step::kNoise ? 0 : std::min(in_a_row_ + 1, kBelieved);
    if (taken == Step::kOther && in_a_row_ == kBelieved) ++others_;
    if (taken != Step::kFrame) continue;
    ++frames_;
    return frame;
  }
  return std::nullopt;
}

}  // namespace fiducap::mavlink
