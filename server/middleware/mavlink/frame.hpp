#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/byte_writer.hpp"
#include "middleware/mavlink/protocol.hpp"

/// MAVLink's frames ↔ bytes, pure. Little-endian; a payload's trailing zeros are not sent.
namespace fiducap::mavlink {

/// The sender.
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
};

/// What stands around the payload of a frame that is appended to `out`.
void begin_frame(const Sender& from, MessageId message, std::vector<std::byte>& out);
/// @param start  where the frame began in `out`
void end_frame(std::size_t start, MessageId message, std::vector<std::byte>& out);

/// Appends a whole frame. @param write  the fields, to a LittleEndianWriter
template <typename Write>
void append_frame(const Sender& from, MessageId message, std::vector<std::byte>& out,
                  Write&& write) {
  const std::size_t start = out.size();
  begin_frame(from, message, out);
  LittleEndianWriter to(out);
  write(to);
  end_frame(start, message, out);
}

/// The payload with the zeros that were not sent; what is longer is cut off.
template <std::size_t N>
[[nodiscard]] std::array<std::byte, N> whole_payload(const Frame& frame) {
  std::array<std::byte, N> payload{};
  std::copy_n(frame.payload.begin(), std::min(N, frame.payload.size()), payload.begin());
  return payload;
}

/// Takes the next frame of a message we know from `in`, with a right checksum. Other messages and
/// noise are passed over; what is left of a datagram afterwards is less than a frame.
/// @return nullopt when there is none
[[nodiscard]] std::optional<Frame> next_frame(std::span<const std::byte>& in);

/// Frames out of a stream whose pieces end anywhere. Allocates nothing; a piece that is longer than
/// its memory is taken bit by bit.
class FrameStream final {
 public:
  /// @param take  called with every frame of a message we know, as `next_frame` has it
  template <typename Take>
  void add(std::span<const std::byte> piece, Take&& take) {
    while (!piece.empty()) {
      piece = piece.subspan(keep(piece));
      while (const auto frame = next()) take(*frame);
    }
  }
  /// What waits belongs to a sender that is gone.
  void clear() { begin_ = end_ = 0; }

  [[nodiscard]] std::uint64_t frames() const { return frames_; }  ///< Of messages we know.
  /// … of others, whose checksum nobody knows here: believed when several frames follow each other
  /// without a byte between, as they never do by chance.
  [[nodiscard]] std::uint64_t others() const { return others_; }
  [[nodiscard]] std::uint64_t broken() const { return broken_; }  ///< … with a wrong checksum.

 private:
  /// @return how many bytes there was room for; never none
  std::size_t keep(std::span<const std::byte> piece);
  [[nodiscard]] std::optional<Frame> next();

  std::array<std::byte, 4 * kMaxFrame> waiting_{};
  std::size_t begin_{0};
  std::size_t end_{0};
  std::uint64_t frames_{0};
  std::uint64_t broken_{0};
  std::uint64_t others_{0};
  int in_a_row_{0};  ///< Frames of any message without a byte between.
};

}  // namespace fiducap::mavlink
