// Golden bytes: made by mavlink/c_library_v2, commit 7e16bc08f14a4f8bfab474de831013a6455ee3da, from
// the same numbers.
#include "streaming/mavlink/codec.hpp"

#include <gmock/gmock.h>

#include "support/hex.hpp"

namespace fiducap::mavlink {
namespace {

using testing::SizeIs;

/// Every field different, so that no swapped order can pass.
PoseReport example_report() {
  PoseReport report;
  report.time_us = 5'000'000;
  report.odometry.p_NF = {1.0, -2.0, 0.25};
  report.odometry.q_NF = Eigen::Quaterniond(2 / 9., 4 / 9., 5 / 9., 6 / 9.);
  report.odometry.v_NF_F = {0.5, -0.25, 0.125};
  report.odometry.w_NF_F = {0.1, 0.2, 0.3};
  int next = 1;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column, ++next) {
      report.odometry.pose_covariance(row, column) = report.odometry.pose_covariance(column, row) =
          next;
      report.odometry.twist_covariance(row, column) =
          report.odometry.twist_covariance(column, row) = 0.5 * next;
    }
  }
  report.reset_counter = 3;
  report.quality = 77;
  return report;
}

const char* const kOdometry =
    "fde90000ff03c54b0100404b4c00000000000000803f000000c00000803e398e633e398ee33ee4380e3fabaa2a3f00"
    "00003f000080be0000003e"
    "cdcccc3dcdcc4c3e9a99993e0000803f0000004000004040000080400000a0400000c0400000e04000000041000010"
    "41000020410000304100"
    "004041000050410000604100007041000080410000884100009041000098410000a0410000a8410000003f0000803f"
    "0000c03f000000400000"
    "2040000040400000604000008040000090400000a0400000b0400000c0400000d0400000e0400000f0400000004100"
    "00084100001041000018"
    "410000204100002841140c03064d9238";
const char* const kHeartbeatOfPx4InVersion1 = "fe090401010000000000020c5104033844";
const char* const kAnswer = "fd0d00000901c56f0000fbffffffffffffff141a99be1c1470";

template <typename Encode>
std::vector<std::byte> bytes_of(Encode&& encode) {
  std::vector<std::byte> out;
  encode(out);
  return out;
}

TEST(MavlinkCodec, OdometryIsByteForByteThatOfThePublicLibrary) {
  const auto bytes = bytes_of([](auto& out) {
    encode_odometry({3, 197, 255}, example_report(), out);
  });
  EXPECT_EQ(to_hex(bytes), to_hex(from_hex(kOdometry)));
}

TEST(MavlinkCodec, VisionPositionIsByteForByteThatOfThePublicLibrary) {
  auto report = example_report();
  const Eigen::AngleAxisd roll(0.1, Eigen::Vector3d::UnitX());
  const Eigen::AngleAxisd pitch(-0.2, Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd yaw(0.3, Eigen::Vector3d::UnitZ());
  report.odometry.q_NF = yaw * pitch * roll;
  const auto bytes = bytes_of([&](auto& out) { encode_vision_position({3, 197, 0}, report, out); });
  EXPECT_EQ(to_hex(bytes), to_hex(from_hex("fd7500000003c5660000404b4c00000000000000803f000000c0000"
                                           "0803ecdcccc3dcdcc4cbe9a99993e0000803f00000040000040"
                                           "40000080400000a0400000c0400000e040000000410000104100002"
                                           "04100003041000040410000504100006041000070410000804"
                                           "10000884100009041000098410000a0410000a84103256a")));
}

TEST(MavlinkCodec, HeartbeatAndClockQuestionAreThoseOfThePublicLibrary) {
  const auto heartbeat = bytes_of([](auto& out) {
    encode_heartbeat({1, 197, 7}, {18, 8, 4}, out);
  });
  EXPECT_EQ(to_hex(heartbeat), "fd0900000701c50000000000000012080004035d56");
  const auto question = bytes_of([](auto& out) {
    encode_timesync({1, 197, 8}, {0, 123456789012}, out);
  });
  EXPECT_EQ(to_hex(question), "fd0d00000801c56f00000000000000000000141a99be1c4475");
}

TEST(MavlinkCodec, ReadsVersionOneAndTwo) {
  const auto old = from_hex(kHeartbeatOfPx4InVersion1);
  std::span<const std::byte> in(old);
  const auto heartbeat = next_frame(in);
  ASSERT_TRUE(heartbeat);
  EXPECT_EQ(heartbeat->system, 1);
  EXPECT_EQ(decode_heartbeat(*heartbeat).autopilot, 12);
  EXPECT_EQ(decode_heartbeat(*heartbeat).type, 2);
  EXPECT_THAT(in, SizeIs(0));

  const auto bytes = from_hex(kAnswer);
  in = bytes;
  const auto answer = next_frame(in);
  ASSERT_TRUE(answer);
  EXPECT_EQ(decode_timesync(*answer).tc1_ns, -5);
  EXPECT_EQ(decode_timesync(*answer).ts1_ns, 123456789012);  // its high bytes were not sent
}

TEST(MavlinkCodec, EveryTruncationIsNoFrame) {
  for (const char* golden : {kOdometry, kHeartbeatOfPx4InVersion1, kAnswer}) {
    const auto whole = from_hex(golden);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      std::span<const std::byte> in(whole.data(), size);
      EXPECT_FALSE(next_frame(in)) << size << " bytes of " << golden;
    }
  }
}

TEST(MavlinkCodec, EveryDamagedByteIsNoticed) {
  const auto whole = from_hex(kAnswer);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    // The flags (3) that do not change the frame's form are covered by the checksum, too.
    auto damaged = whole;
    damaged[at] ^= std::byte{0x40};
    std::span<const std::byte> in(damaged);
    EXPECT_FALSE(next_frame(in)) << "byte " << at;
  }
}

TEST(MavlinkCodec, FindsTheFrameBehindNoiseAndStrangersMessages) {
  auto bytes = from_hex("fd00 ff 13 37 fe");  // noise that looks like the beginning of a frame
  const auto stranger = from_hex("fd 03 00 00 01 01 01 ff ff 00 010203 0000");  // message 65535
  const auto known = from_hex(kAnswer);
  bytes.insert(bytes.end(), stranger.begin(), stranger.end());
  bytes.insert(bytes.end(), known.begin(), known.end());
  std::span<const std::byte> in(bytes);
  const auto frame = next_frame(in);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->message, static_cast<std::uint32_t>(MessageId::kTimesync));
  EXPECT_FALSE(next_frame(in));
}

TEST(MavlinkCodec, ASignedFrameIsReadWithItsSignature) {
  std::vector<std::byte> bytes;
  encode_timesync({1, 1, 0}, {0, 77}, bytes);
  // Signed frames have another checksum: build one by hand from a frame that says so.
  auto frame = from_hex("fd 0a 01 00 00 01 01 6f 00 00 00000000000000004d01 0000");
  std::uint16_t crc = 0xffff;
  const auto add = [&crc](std::byte byte) {
    auto t = static_cast<std::uint8_t>(static_cast<std::uint8_t>(byte) ^ (crc & 0xff));
    t = static_cast<std::uint8_t>(t ^ (t << 4));
    crc = static_cast<std::uint16_t>((crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4));
  };
  for (std::size_t i = 1; i < 20; ++i) add(frame[i]);
  add(std::byte{34});
  frame[20] = static_cast<std::byte>(crc & 0xff);
  frame[21] = static_cast<std::byte>(crc >> 8);
  std::span<const std::byte> in(frame);
  EXPECT_FALSE(next_frame(in));  // its signature is missing
  frame.resize(frame.size() + kSignature);
  in = frame;
  EXPECT_TRUE(next_frame(in));
  EXPECT_THAT(in, SizeIs(0));
}

}  // namespace
}  // namespace fiducap::mavlink
