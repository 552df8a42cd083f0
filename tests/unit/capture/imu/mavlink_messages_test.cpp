#include "capture/imu/mavlink_vehicle.hpp"

#include <gtest/gtest.h>

#include "support/hex.hpp"
#include "unit/capture/imu/mavlink_bytes.hpp"

namespace fiducap::mavlink {
namespace {

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

TEST(MavlinkMessages, HighresImuIsReadInItsUnits) {
  const InertialReading reading = reading_of(golden::kHighres);
  EXPECT_EQ(reading.count, 123'456'789u);
  EXPECT_FALSE(reading.counts_ms);
  EXPECT_TRUE(reading.is_new);
  EXPECT_EQ(reading.f, Eigen::Vector3d(0.5, -0.25, -9.75));
  EXPECT_EQ(reading.w, Eigen::Vector3d(0.125, -0.0625, 0.03125));
}

TEST(MavlinkMessages, HighresImuSaysWhatWasNotReadAnew) {
  EXPECT_FALSE(reading_of(golden::kHighresWithoutGyro).is_new);
}

TEST(MavlinkMessages, ASignatureIsTolerated) {
  EXPECT_EQ(reading_of(golden::kHighresSigned).count, 223'456'789u);
}

TEST(MavlinkMessages, RawAndScaledReadingsAreThousandths) {
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

TEST(MavlinkMessages, RequestsAreByteForByteThoseOfThePublicLibrary) {
  std::vector<std::byte> out;
  encode_message_interval({3, 191, 4}, {3, 1}, MessageId::kHighresImu, 200, out);
  EXPECT_EQ(to_hex(out), golden::kAskForHighres);
  out.clear();
  encode_sensor_stream_request({3, 191, 5}, {3, 1}, 50, out);
  EXPECT_EQ(to_hex(out), golden::kAskForStream);
}

TEST(MavlinkMessages, ATruncatedPayloadIsZerosAndNothingElse) {
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
