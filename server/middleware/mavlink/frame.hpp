#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/bytes.hpp"

/// MAVLink frames ↔ bytes, and the messages that IMU and streaming share. No I/O. Little-endian;
/// the trailing zeros of a payload are not sent. Writes version 2, reads 1 and 2 (common.xml).
namespace fiducap::mavlink {

enum class MessageId : std::uint32_t {
  kHeartbeat = 0,
  kScaledImu = 26,
  kRawImu = 27,
  kRequestDataStream = 66,
  kCommandLong = 76,
  kCommandAck = 77,
  kVisionPositionEstimate = 102,
  kHighresImu = 105,
  kTimesync = 111,
  kScaledImu2 = 116,
  kScaledImu3 = 129,
  kOdometry = 331,
};

inline constexpr std::uint8_t kMagic1 = 0xfe;
inline constexpr std::uint8_t kMagic2 = 0xfd;
inline constexpr std::size_t kHeader1 = 6;
inline constexpr std::size_t kHeader2 = 10;
inline constexpr std::size_t kChecksum = 2;
inline constexpr std::size_t kSignature = 13;
inline constexpr std::size_t kMaxPayload = 255;
inline constexpr std::size_t kMaxFrame = kHeader2 + kMaxPayload + kChecksum + kSignature;
inline constexpr std::uint8_t kSigned = 0x01;  ///< Of the incompatibility flags.

inline constexpr std::uint8_t kOnboardController = 18;  ///< MAV_TYPE
inline constexpr std::uint8_t kNoAutopilot = 8;         ///< MAV_AUTOPILOT_INVALID
inline constexpr std::uint8_t kArduPilot = 3;           ///< MAV_AUTOPILOT
inline constexpr std::uint8_t kPx4 = 12;
inline constexpr std::uint8_t kStateStandby = 3;  ///< MAV_STATE
inline constexpr std::uint8_t kStateActive = 4;
inline constexpr std::uint8_t kProtocolVersion = 3;
inline constexpr std::uint8_t kFrameLocalNed = 1;  ///< MAV_FRAME
inline constexpr std::uint8_t kFrameBodyFrd = 12;
inline constexpr std::uint8_t kFrameLocalFrd = 20;
inline constexpr std::uint8_t kEstimatorMocap = 6;     ///< MAV_ESTIMATOR_TYPE
inline constexpr std::uint8_t kOnboardComputer = 191;  ///< MAV_COMP_ID
inline constexpr std::uint8_t kVisualInertialOdometry = 197;
inline constexpr std::uint16_t kSetMessageInterval = 511;  ///< MAV_CMD
inline constexpr std::uint8_t kRawSensors = 1;             ///< MAV_DATA_STREAM

struct Sender {
  std::uint8_t system{};
  std::uint8_t component{};
  std::uint8_t sequence{};
};

struct Frame {
  std::uint32_t message{};
  std::uint8_t system{};
  std::uint8_t component{};
  std::span<const std::byte> payload;

  [[nodiscard]] bool is(MessageId id) const { return message == static_cast<std::uint32_t>(id); }
};

/// Header and end of a frame that is appended to `out`, around its payload.
void begin_frame(const Sender& from, MessageId message, std::vector<std::byte>& out);
/// @param start  index of the frame in `out`
void end_frame(std::size_t start, MessageId message, std::vector<std::byte>& out);

/// Appends a frame. @param write  writes the fields to a LittleEndianWriter
template <typename Write>
void append_frame(const Sender& from, MessageId message, std::vector<std::byte>& out,
                  Write&& write) {
  const std::size_t start = out.size();
  begin_frame(from, message, out);
  LittleEndianWriter to(out);
  write(to);
  end_frame(start, message, out);
}

/// The first N bytes of the payload; bytes that were not sent are zero.
template <std::size_t N>
[[nodiscard]] std::array<std::byte, N> whole_payload(const Frame& frame) {
  std::array<std::byte, N> payload{};
  std::copy_n(frame.payload.begin(), std::min(N, frame.payload.size()), payload.begin());
  return payload;
}

/// Removes the next intact frame of a known message from `in`. Skips other messages and noise.
/// @return nullopt when there is none; the rest of the datagram is then less than a frame
[[nodiscard]] std::optional<Frame> next_frame(std::span<const std::byte>& in);

/// Extracts frames from a stream that arrives in pieces of any size. Allocates nothing.
class FrameStream final {
 public:
  /// @param take  called with every frame of a known message, as `next_frame` returns it
  template <typename Take>
  void add(std::span<const std::byte> piece, Take&& take) {
    while (!piece.empty()) {
      piece = piece.subspan(keep(piece));
      while (const auto frame = next()) take(*frame);
    }
  }
  /// Drops the buffered bytes, e.g. those of another sender.
  void clear() { begin_ = end_ = 0; }

  [[nodiscard]] std::uint64_t frames() const { return frames_; }  ///< Of known messages.
  /// Frames of unknown messages, whose checksum cannot be tested: counted when several frames
  /// follow each other without a byte between them, which does not happen by chance.
  [[nodiscard]] std::uint64_t others() const { return others_; }
  [[nodiscard]] std::uint64_t broken() const { return broken_; }  ///< Frames with a wrong checksum.

 private:
  /// @return number of bytes that were buffered, > 0
  std::size_t keep(std::span<const std::byte> piece);
  [[nodiscard]] std::optional<Frame> next();

  std::array<std::byte, 4 * kMaxFrame> buffer_{};
  std::size_t begin_{0};
  std::size_t end_{0};
  std::uint64_t frames_{0};
  std::uint64_t broken_{0};
  std::uint64_t others_{0};
  int in_a_row_{0};  ///< Frames of any message without a byte between them.
};

struct Timesync {
  std::int64_t tc1_ns{};  ///< 0: a request. Else the replying side's clock.
  std::int64_t ts1_ns{};  ///< The requesting side's clock at the request.
};

struct Heartbeat {
  std::uint8_t type{};
  std::uint8_t autopilot{};
  std::uint8_t system_status{};
};

void encode_heartbeat(const Sender& from, const Heartbeat& heartbeat, std::vector<std::byte>& out);
void encode_timesync(const Sender& from, const Timesync& timesync, std::vector<std::byte>& out);

/// @pre the frame is of that message. Bytes that were not sent are zero.
[[nodiscard]] Timesync decode_timesync(const Frame& frame);
[[nodiscard]] Heartbeat decode_heartbeat(const Frame& frame);

}  // namespace fiducap::mavlink
