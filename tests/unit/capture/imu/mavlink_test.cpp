// Streams and messages; single frames: tests/unit/streaming/mavlink/vehicle_link_test.cpp.
#include <gmock/gmock.h>

#include <random>

#include "capture/imu/mavlink_vehicle.hpp"
#include "middleware/mavlink/frame.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "unit/capture/imu/mavlink_bytes.hpp"

namespace fiducap::mavlink {
namespace {

using testing::ElementsAre;

std::vector<std::byte> stream_of(std::initializer_list<const char*> frames) {
  std::string all;
  for (const char* hex : frames) all += hex;
  return from_hex(all);
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

TEST(FrameStream, ReadsPiecesThatEndAnywhere) {
  for (const std::size_t piece : {1u, 2u, 7u, 63u, 1000u}) {
    FrameStream stream;
    EXPECT_EQ(messages_in(stream, example(), piece), kMessages) << piece;
    EXPECT_EQ(stream.broken(), 0u);
    EXPECT_EQ(stream.frames(), kMessages.size());
  }
}

TEST(FrameStream, SkipsNoiseAndCountsDamagedFrames) {
  FrameStream stream;
  const auto noisy =
      stream_of({"0012ab", golden::kHighres, "5555", golden::kRaw, golden::kHeartbeatOfPx4});
  EXPECT_THAT(messages_in(stream, noisy, 5), ElementsAre(105, 27, 0));
  stream = {};
  auto damaged = stream_of({golden::kHighres, golden::kRaw});
  damaged[30] ^= std::byte{0x10};
  EXPECT_THAT(messages_in(stream, damaged, 1000), ElementsAre(27));
  EXPECT_GE(stream.broken(), 1u);
}

TEST(FrameStream, CountsUnknownMessagesInSequence) {
  FrameStream stream;
  std::string hundred;
  for (int i = 0; i < 100; ++i) hundred += golden::kAttitude;
  EXPECT_TRUE(messages_in(stream, from_hex(hundred), 13).empty());
  EXPECT_EQ(stream.others(), 97u);
}

TEST(FrameStream, AllocatesNothingForRandomBytes) {
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

constexpr double kG_m_s2 = 9.80665;
constexpr double kRounding = 1e-12;

InertialReading reading_of(const char* hex) {
  const auto bytes = from_hex(hex);
  std::span<const std::byte> in(bytes);
  const auto frame = next_frame(in);
  EXPECT_TRUE(frame);
  const auto reading = decode_inertial(*frame);
  EXPECT_TRUE(reading);
  EXPECT_TRUE(in.empty());
  return reading.value_or(InertialReading{});
}

void expect_scaled(const InertialReading& reading, double last) {
  const Eigen::Vector3d f = kG_m_s2 * Eigen::Vector3d(10 + last, -20 - last, -1000 - last) / 1000;
  const Eigen::Vector3d w = Eigen::Vector3d(100 + last, -200 - last, 300 + last) / 1000;
  EXPECT_NEAR((reading.f - f).norm(), 0, kRounding);
  EXPECT_NEAR((reading.w - w).norm(), 0, kRounding);
}

TEST(MavlinkMessages, ReadsHighresImuInItsUnits) {
  EXPECT_THAT(
      reading_of(golden::kHighres),
      testing::FieldsAre(123'456'789u, false, true, Eigen::Vector3d(0.125, -0.0625, 0.03125),
                         Eigen::Vector3d(0.5, -0.25, -9.75)));
  EXPECT_FALSE(reading_of(golden::kHighresWithoutGyro).is_new);
  EXPECT_EQ(reading_of(golden::kHighresSigned).count, 223'456'789u);
}

TEST(MavlinkMessages, ReadsRawAndScaledReadingsAsThousandths) {
  const InertialReading raw = reading_of(golden::kRaw);
  EXPECT_EQ(raw.count, 98'765'432u);
  EXPECT_FALSE(raw.counts_ms);
  expect_scaled(raw, 0);
  for (const auto& [hex, last] : {std::pair(golden::kScaled, 2), std::pair(golden::kScaled2, 0),
                                  std::pair(golden::kScaled3, 1)}) {
    const InertialReading scaled = reading_of(hex);
    EXPECT_EQ(scaled.count, 4'000'123u);
    EXPECT_TRUE(scaled.counts_ms);
    expect_scaled(scaled, last);
  }
}

TEST(MavlinkMessages, EncodesRequestsLikeThePublicLibrary) {
  std::vector<std::byte> out;
  encode_message_interval({3, 191, 4}, {3, 1}, MessageId::kHighresImu, 200, out);
  EXPECT_EQ(to_hex(out), golden::kAskForHighres);
  out.clear();
  encode_sensor_stream_request({3, 191, 5}, {3, 1}, 50, out);
  EXPECT_EQ(to_hex(out), golden::kAskForStream);
}

TEST(MavlinkMessages, ReadsATruncatedPayloadAsZeros) {
  const auto bytes = from_hex(golden::kHighres);
  const Frame whole{105, 3, 1, std::span(bytes).subspan(10, 62)};
  for (std::size_t size = 0; size < whole.payload.size(); ++size) {
    Frame cut = whole;
    cut.payload = whole.payload.first(size);
    EXPECT_TRUE(decode_inertial(cut));
  }
}

}  // namespace
}  // namespace fiducap::mavlink
