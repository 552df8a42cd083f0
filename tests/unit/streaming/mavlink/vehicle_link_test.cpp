// Golden bytes are of the same numbers by mavlink/c_library_v2, commit
// 7e16bc08f14a4f8bfab474de831013a6455ee3da.
#include <gmock/gmock.h>

#include <chrono>
#include <map>
#include <optional>

#include "streaming/mavlink/vehicle_link.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::mavlink {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::IsEmpty;

/// Each field is different, so that the test finds swapped ones.
PoseReport example_report() {
  PoseReport report;
  report.time_us = 5'000'000;
  report.odometry.p_NF = {1.0, -2.0, 0.25};
  report.odometry.q_NF = Eigen::Quaterniond(2 / 9., 4 / 9., 5 / 9., 6 / 9.);
  report.odometry.v_NF_F = {0.5, -0.25, 0.125};
  report.odometry.w_NF_F = {0.1, 0.2, 0.3};
  auto& covariance = report.odometry.pose_covariance;
  int next = 1;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column, ++next)
      covariance(row, column) = covariance(column, row) = next;
  }
  report.odometry.twist_covariance = 0.5 * covariance;
  report.reset_counter = 3;
  report.quality = 77;
  return report;
}

const char* const kOdometry =
    "fde90000ff03c54b0100404b4c00000000000000803f000000c00000803e398e633e398ee33ee4380e3fabaa2a3f"
    "0000003f000080be0000003ecdcccc3dcdcc4c3e9a99993e0000803f0000004000004040000080400000a0400000"
    "c0400000e04000000041000010410000204100003041000040410000504100006041000070410000804100008841"
    "00009041000098410000a0410000a8410000003f0000803f0000c03f000000400000204000004040000060400000"
    "8040000090400000a0400000b0400000c0400000d0400000e0400000f04000000041000008410000104100001841"
    "0000204100002841140c03064d9238";
const char* const kHeartbeatOfPx4InVersion1 = "fe090401010000000000020c5104033844";
const char* const kAnswer = "fd0d00000901c56f0000fbffffffffffffff141a99be1c1470";

const char* const kVisionPosition =
    "fd7500000003c5660000404b4c00000000000000803f000000c00000803ecdcccc3dcdcc4cbe9a99993e0000803f"
    "0000004000004040000080400000a0400000c0400000e04000000041000010410000204100003041000040410000"
    "50410000604100007041000080410000884100009041000098410000a0410000a84103256a";

TEST(MavlinkCodec, MessagesAreThoseOfThePublicLibrary) {
  auto report = example_report();
  std::vector<std::byte> out;
  encode_odometry({3, 197, 255}, report, out);
  EXPECT_EQ(to_hex(out), kOdometry);
  const Eigen::AngleAxisd roll(0.1, Eigen::Vector3d::UnitX());
  const Eigen::AngleAxisd pitch(-0.2, Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd yaw(0.3, Eigen::Vector3d::UnitZ());
  report.odometry.q_NF = yaw * pitch * roll;
  out.clear();
  encode_vision_position({3, 197, 0}, report, out);
  EXPECT_EQ(to_hex(out), kVisionPosition);
  out.clear();
  encode_heartbeat({1, 197, 7}, {18, 8, 4}, out);
  EXPECT_EQ(to_hex(out), "fd0900000701c50000000000000012080004035d56");
  out.clear();
  encode_timesync({1, 197, 8}, {0, 123456789012}, out);
  EXPECT_EQ(to_hex(out), "fd0d00000801c56f00000000000000000000141a99be1c4475");
}

TEST(MavlinkCodec, DecodesVersionsOneAndTwo) {
  const auto old = from_hex(kHeartbeatOfPx4InVersion1);
  std::span<const std::byte> in(old);
  const auto heartbeat = next_frame(in);
  ASSERT_TRUE(heartbeat);
  EXPECT_EQ(heartbeat->system, 1);
  EXPECT_EQ(decode_heartbeat(*heartbeat).autopilot, 12);
  EXPECT_EQ(decode_heartbeat(*heartbeat).type, 2);
  EXPECT_THAT(in, IsEmpty());
  const auto bytes = from_hex(kAnswer);
  in = bytes;
  const auto answer = next_frame(in);
  ASSERT_TRUE(answer);
  EXPECT_EQ(decode_timesync(*answer).tc1_ns, -5);
  EXPECT_EQ(decode_timesync(*answer).ts1_ns, 123456789012);  // its high bytes were not sent
}

TEST(MavlinkCodec, RefusesTruncatedAndDamagedFrames) {
  for (const char* golden : {kOdometry, kHeartbeatOfPx4InVersion1, kAnswer}) {
    const auto whole = from_hex(golden);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      std::span<const std::byte> in(whole.data(), size);
      EXPECT_FALSE(next_frame(in)) << size << " bytes of " << golden;
    }
  }
  const auto whole = from_hex(kAnswer);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    auto damaged = whole;
    damaged[at] ^= std::byte{0x40};
    std::span<const std::byte> in(damaged);
    EXPECT_FALSE(next_frame(in)) << "byte " << at;
  }
}

TEST(MavlinkCodec, FindsAFrameAfterNoiseAndUnknownMessages) {
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

TEST(MavlinkCodec, DecodesASignedFrame) {
  // The flag changes the checksum.
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
  EXPECT_FALSE(next_frame(in)) << "without its signature";
  frame.resize(frame.size() + kSignature);
  in = frame;
  EXPECT_TRUE(next_frame(in));
  EXPECT_THAT(in, IsEmpty());
}

class VehicleLinkTest : public testing::Test {
 protected:
  VehicleLinkTest() {
    config_.body = "drone";
    config_.rate_hz = 50;
  }
  /// One frame of 100 Hz. @return its messages by id; the payloads point to the datagram
  std::multimap<std::uint32_t, Frame> step() {
    frame_->at += 10ms;
    ++frame_->number;
    datagram_.clear();
    link().publish(*frame_, body_is_there_ ? &frame_->bodies[0] : nullptr, 0, frame_->at,
                   datagram_);
    std::multimap<std::uint32_t, Frame> messages;
    std::span<const std::byte> in(datagram_);
    while (const auto message = next_frame(in)) messages.emplace(message->message, *message);
    return messages;
  }
  /// @return how many messages of each id
  std::map<std::uint32_t, int> run(int frames) {
    std::map<std::uint32_t, int> counts;
    for (int i = 0; i < frames; ++i)
      for (const auto& [id, message] : step()) ++counts[id];
    return counts;
  }
  /// @return the replies
  std::vector<std::byte> receive(const std::vector<std::byte>& bytes, Duration later = 0ms) {
    std::vector<std::byte> replies;
    link().receive(bytes, frame_->at + later, replies);
    return replies;
  }
  /// With the configuration of its first use.
  VehicleLink& link() { return link_ ? *link_ : link_.emplace(config_); }

  VehicleConfig config_;
  std::optional<VehicleLink> link_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"drone"});
  bool body_is_there_{true};
  std::vector<std::byte> datagram_;
};

constexpr auto kOdometryId = static_cast<std::uint32_t>(MessageId::kOdometry);
constexpr auto kVisionId = static_cast<std::uint32_t>(MessageId::kVisionPositionEstimate);
constexpr auto kHeartbeatId = static_cast<std::uint32_t>(MessageId::kHeartbeat);
constexpr auto kTimesyncId = static_cast<std::uint32_t>(MessageId::kTimesync);

TEST_F(VehicleLinkTest, SendsTheConfiguredMessagesAtTheirRates) {
  const auto counts = run(1000);
  EXPECT_EQ(counts.at(kOdometryId), 500);
  EXPECT_EQ(counts.at(kHeartbeatId), 10);
  EXPECT_EQ(counts.count(kVisionId), 0u);
  config_.rate_hz = 30;
  config_.message = PoseMessage::kBoth;
  link_.reset();
  const auto both = run(1000);
  EXPECT_NEAR(both.at(kOdometryId), 300, 1);
  EXPECT_EQ(both.at(kVisionId), both.at(kOdometryId));
}

TEST_F(VehicleLinkTest, SendsNoInvalidPose) {
  frame_->bodies[0].valid = false;
  const auto counts = run(200);
  EXPECT_EQ(counts.count(kOdometryId), 0u);
  EXPECT_EQ(counts.at(kHeartbeatId), 2);
  frame_->bodies[0].valid = true;
  frame_->bodies[0].v_WP.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(run(100).count(kOdometryId), 0u);
  body_is_there_ = false;
  EXPECT_EQ(run(100).count(kOdometryId), 0u);
}

TEST_F(VehicleLinkTest, HeartbeatHasTheValidityOfThePose) {
  const auto status = [this] {
    const auto messages = step();
    const auto heartbeat = messages.find(kHeartbeatId);
    return heartbeat == messages.end() ? -1 : decode_heartbeat(heartbeat->second).system_status;
  };
  EXPECT_EQ(status(), kStateActive);
  frame_->bodies[0].valid = false;
  run(99);
  EXPECT_EQ(status(), kStateStandby);
}

TEST_F(VehicleLinkTest, RepliesToAClockRequestWithItsClock) {
  std::vector<std::byte> request;
  encode_timesync({1, 1, 0}, {0, 123456789012}, request);
  const auto replies = receive(request);
  std::span<const std::byte> in(replies);
  const auto reply = next_frame(in);
  ASSERT_TRUE(reply);
  EXPECT_EQ(decode_timesync(*reply).ts1_ns, 123456789012);
  EXPECT_EQ(decode_timesync(*reply).tc1_ns, to_ns(frame_->at));
}

TEST_F(VehicleLinkTest, RepliesAreNotLongerThanTheRequests) {
  const auto version_one = from_hex("fe100501016f00000000000000000807060504030201bb65");
  std::vector<std::byte> many;
  for (int i = 0; i < 40; ++i) many.insert(many.end(), version_one.begin(), version_one.end());
  const auto replies = receive(many);
  EXPECT_LE(replies.size(), many.size());
  EXPECT_FALSE(replies.empty());
}

TEST_F(VehicleLinkTest, PoseHasTheStampOfTheFrame) {
  const auto messages = step();
  const auto odometry = messages.find(kOdometryId);
  ASSERT_NE(odometry, messages.end());
  std::uint64_t time_us = 0;
  std::memcpy(&time_us, odometry->second.payload.data(), sizeof(time_us));
  EXPECT_EQ(time_us, static_cast<std::uint64_t>(to_ns(frame_->at) / 1000));
}

TEST_F(VehicleLinkTest, ReportsTheAutopilotAndItsClock) {
  EXPECT_THAT(link().status(frame_->at), HasSubstr("no heartbeat"));
  const auto messages = step();
  const auto request = messages.find(kTimesyncId);
  ASSERT_NE(request, messages.end());
  std::vector<std::byte> from_autopilot;
  encode_heartbeat({9, 1, 0}, {2, 12, 4}, from_autopilot);
  const std::int64_t halfway = to_ns(frame_->at) + 500'000;
  encode_timesync({9, 1, 1}, {halfway + 5'000'000, decode_timesync(request->second).ts1_ns},
                  from_autopilot);
  EXPECT_THAT(receive(from_autopilot, 1ms), IsEmpty());
  EXPECT_THAT(link().status(frame_->at + 1ms), HasSubstr("system 9"));
  const auto clock = link().clock_offset(frame_->at + 1ms);
  ASSERT_TRUE(clock);
  EXPECT_EQ(clock->to_autopilot, Duration(5ms));
  EXPECT_EQ(clock->bound, Duration(500us));
}

TEST_F(VehicleLinkTest, IgnoresHeartbeatsOfOtherCompanions) {
  std::vector<std::byte> bytes;
  encode_heartbeat({9, 191, 0}, {kOnboardController, kNoAutopilot, 4}, bytes);
  (void)receive(bytes);
  EXPECT_THAT(link().status(frame_->at), HasSubstr("no heartbeat"));
}

}  // namespace
}  // namespace fiducap::mavlink
