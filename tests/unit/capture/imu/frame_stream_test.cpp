// Frames out of streams; single frames: tests/unit/streaming/mavlink/vehicle_link_test.cpp.
#include <gtest/gtest.h>

#include <random>

#include "middleware/mavlink/frame.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "unit/capture/imu/mavlink_bytes.hpp"

namespace fiducap::mavlink {
namespace {

std::vector<std::byte> stream_of(std::initializer_list<const char*> frames) {
  std::vector<std::byte> bytes;
  for (const char* hex : frames) {
    const auto frame = from_hex(hex);
    bytes.insert(bytes.end(), frame.begin(), frame.end());
  }
  return bytes;
}

std::vector<std::uint32_t> messages_in(FrameStream& stream, std::span<const std::byte> bytes,
                                       std::size_t piece) {
  std::vector<std::uint32_t> messages;
  while (!bytes.empty()) {
    const std::size_t size = std::min(piece, bytes.size());
    stream.add(bytes.first(size), [&](const Frame& frame) { messages.push_back(frame.message); });
    bytes = bytes.subspan(size);
  }
  return messages;
}

const std::vector<std::uint32_t> kMessages{0, 105, 27, 116, 105};

std::vector<std::byte> example() {
  return stream_of({golden::kHeartbeatOfPx4, golden::kHighres, golden::kAttitude, golden::kRaw,
                    golden::kScaled2, golden::kHighresSigned});
}

TEST(FrameStream, PiecesMayEndAnywhere) {
  for (const std::size_t piece : {1u, 2u, 7u, 63u, 1000u}) {
    FrameStream stream;
    EXPECT_EQ(messages_in(stream, example(), piece), kMessages) << piece;
    EXPECT_EQ(stream.broken(), 0u);
    EXPECT_EQ(stream.frames(), kMessages.size());
  }
}

TEST(FrameStream, NoiseBeforeAndBetweenIsPassedOver) {
  FrameStream stream;
  EXPECT_EQ(messages_in(stream,
                        stream_of({"0012ab", golden::kHighres, "5555", golden::kRaw,
                                   golden::kHeartbeatOfPx4}),
                        5),
            (std::vector<std::uint32_t>{105, 27, 0}));
}

TEST(FrameStream, AFrameWithAFlippedBitIsCountedAndTheNextIsFound) {
  auto bytes = stream_of({golden::kHighres, golden::kRaw});
  bytes[30] ^= std::byte{0x10};
  FrameStream stream;
  EXPECT_EQ(messages_in(stream, bytes, 1000), (std::vector<std::uint32_t>{27}));
  EXPECT_GE(stream.broken(), 1u);
}

TEST(FrameStream, OtherMessagesAreBelievedWhenTheyFollowEachOther) {
  FrameStream stream;
  std::vector<std::byte> bytes;
  for (int i = 0; i < 100; ++i) {
    const auto one = from_hex(golden::kAttitude);
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  EXPECT_TRUE(messages_in(stream, bytes, 13).empty());
  EXPECT_EQ(stream.others(), 97u);
}

TEST(FrameStream, AnEndlessFloodTakesNoMoreMemory) {
  std::mt19937 random(1);
  std::vector<std::byte> flood(100'000);
  for (std::byte& byte : flood) byte = static_cast<std::byte>(random());
  FrameStream stream;
  const AllocationCounter allocations;
  std::size_t frames = 0;
  stream.add(flood, [&](const Frame&) { ++frames; });
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(frames, 0u);
  EXPECT_EQ(stream.others(), 0u);
  stream.clear();
  EXPECT_EQ(messages_in(stream, example(), 3), kMessages);
}

}  // namespace
}  // namespace fiducap::mavlink
