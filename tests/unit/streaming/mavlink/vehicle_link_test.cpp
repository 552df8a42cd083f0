// Golden bytes: made by mavlink/c_library_v2, commit 7e16bc08f14a4f8bfab474de831013a6455ee3da, from
// the same numbers.
#include <gmock/gmock.h>

#include <chrono>
#include <map>

#include "streaming/mavlink/vehicle_link.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

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
  // Signed frames have another checksum: build one by hand from a frame with the flag.
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

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::IsEmpty;

class VehicleLinkTest : public testing::Test {
 protected:
  VehicleLinkTest() {
    config_.body = "drone";
    config_.rate_hz = 50;
  }
  /// Frames at 100 Hz for so long. @return messages by id
  std::map<std::uint32_t, int> run(VehicleLink& link, int frames) {
    std::map<std::uint32_t, int> counts;
    for (int i = 0; i < frames; ++i) {
      frame_->at += 10ms;
      ++frame_->number;
      datagram_.clear();
      link.publish(*frame_, body_is_there_ ? &frame_->bodies[0] : nullptr, 0, frame_->at,
                   datagram_);
      std::span<const std::byte> in(datagram_);
      while (const auto message = next_frame(in)) ++counts[message->message];
    }
    return counts;
  }
  VehicleConfig config_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"drone"});
  bool body_is_there_{true};
  std::vector<std::byte> datagram_;
};

constexpr auto kOdometryId = static_cast<std::uint32_t>(MessageId::kOdometry);
constexpr auto kVisionId = static_cast<std::uint32_t>(MessageId::kVisionPositionEstimate);
constexpr auto kHeartbeatId = static_cast<std::uint32_t>(MessageId::kHeartbeat);
constexpr auto kTimesyncId = static_cast<std::uint32_t>(MessageId::kTimesync);

TEST_F(VehicleLinkTest, SendsAtItsOwnRateWithAHeartbeatASecond) {
  VehicleLink link(config_);
  const auto counts = run(link, 1000);
  EXPECT_EQ(counts.at(kOdometryId), 500);
  EXPECT_EQ(counts.at(kHeartbeatId), 10);
  EXPECT_EQ(counts.count(kVisionId), 0u);
}

TEST_F(VehicleLinkTest, RatesThatDoNotDivideTheFramesAreMetInTheMean) {
  config_.rate_hz = 30;
  VehicleLink link(config_);
  EXPECT_NEAR(run(link, 1000).at(kOdometryId), 300, 1);
}

TEST_F(VehicleLinkTest, SendsBothMessagesWhenAskedTo) {
  config_.message = PoseMessage::kBoth;
  VehicleLink link(config_);
  const auto counts = run(link, 100);
  EXPECT_EQ(counts.at(kOdometryId), 50);
  EXPECT_EQ(counts.at(kVisionId), 50);
}

TEST_F(VehicleLinkTest, SaysNothingAboutAPoseThatMayNotBeUsed) {
  VehicleLink link(config_);
  frame_->bodies[0].valid = false;
  auto counts = run(link, 200);
  EXPECT_EQ(counts.count(kOdometryId), 0u);
  EXPECT_EQ(counts.at(kHeartbeatId), 2);
  frame_->bodies[0].valid = true;
  frame_->bodies[0].v_WP.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(run(link, 100).count(kOdometryId), 0u);
  body_is_there_ = false;
  EXPECT_EQ(run(link, 100).count(kOdometryId), 0u);
}

TEST_F(VehicleLinkTest, HeartbeatSaysWhetherThePoseIsThere) {
  VehicleLink link(config_);
  const auto status_in = [this] {
    std::span<const std::byte> in(datagram_);
    while (const auto message = next_frame(in)) {
      if (message->message == kHeartbeatId)
        return static_cast<int>(decode_heartbeat(*message).system_status);
    }
    return -1;
  };
  run(link, 1);
  EXPECT_EQ(status_in(), kStateActive);
  frame_->bodies[0].valid = false;
  run(link, 100);
  EXPECT_EQ(status_in(), kStateStandby);
}

TEST_F(VehicleLinkTest, AnswersTheClockQuestionWithItsOwnClock) {
  VehicleLink link(config_);
  std::vector<std::byte> question;
  encode_timesync({1, 1, 0}, {0, 123456789012}, question);
  std::vector<std::byte> answers;
  link.receive(question, frame_->at, answers);
  std::span<const std::byte> in(answers);
  const auto answer = next_frame(in);
  ASSERT_TRUE(answer);
  EXPECT_EQ(decode_timesync(*answer).ts1_ns, 123456789012);
  EXPECT_EQ(decode_timesync(*answer).tc1_ns, to_ns(frame_->at));
}

TEST_F(VehicleLinkTest, AnswersWithNoMoreBytesThanCame) {
  VehicleLink link(config_);
  const auto version_one = from_hex("fe100501016f00000000000000000807060504030201bb65");
  std::vector<std::byte> many;
  for (int i = 0; i < 40; ++i) many.insert(many.end(), version_one.begin(), version_one.end());
  std::vector<std::byte> answers;
  link.receive(many, frame_->at, answers);
  EXPECT_LE(answers.size(), many.size());
  EXPECT_FALSE(answers.empty());
}

TEST_F(VehicleLinkTest, StampsTheInstantThePoseIsForOnTheClockThatItAnswersWith) {
  VehicleLink link(config_);
  run(link, 1);
  std::span<const std::byte> in(datagram_);
  const auto odometry = next_frame(in);
  ASSERT_TRUE(odometry);
  ASSERT_EQ(odometry->message, kOdometryId);
  std::uint64_t time_us = 0;
  std::memcpy(&time_us, odometry->payload.data(), sizeof(time_us));
  EXPECT_EQ(time_us, static_cast<std::uint64_t>(to_ns(frame_->at) / 1000));
}

TEST_F(VehicleLinkTest, ShowsTheAutopilotAndItsClockOnceHeard) {
  VehicleLink link(config_);
  EXPECT_THAT(link.status(frame_->at), HasSubstr("no heartbeat"));
  run(link, 1);  // asks
  std::span<const std::byte> in(datagram_);
  std::optional<Timesync> question;
  while (const auto message = next_frame(in)) {
    if (message->message == kTimesyncId) question = decode_timesync(*message);
  }
  ASSERT_TRUE(question);
  std::vector<std::byte> from_autopilot;
  encode_heartbeat({9, 1, 0}, {2, 12, 4}, from_autopilot);
  const std::int64_t halfway = to_ns(frame_->at) + 500'000;
  encode_timesync({9, 1, 1}, {halfway + 5'000'000, question->ts1_ns}, from_autopilot);
  std::vector<std::byte> answers;
  link.receive(from_autopilot, frame_->at + 1ms, answers);
  EXPECT_THAT(answers, IsEmpty());
  EXPECT_THAT(link.status(frame_->at + 1ms), HasSubstr("system 9"));
  const auto clock = link.clock_offset(frame_->at + 1ms);
  ASSERT_TRUE(clock);
  EXPECT_EQ(clock->to_autopilot, Duration(5ms));
  EXPECT_EQ(clock->bound, Duration(500us));
}

TEST_F(VehicleLinkTest, AnotherCompanionIsNotTakenForTheAutopilot) {
  VehicleLink link(config_);
  std::vector<std::byte> bytes;
  encode_heartbeat({9, 191, 0}, {kOnboardController, kNoAutopilot, 4}, bytes);
  std::vector<std::byte> answers;
  link.receive(bytes, frame_->at, answers);
  EXPECT_THAT(link.status(frame_->at), HasSubstr("no heartbeat"));
}

TEST_F(VehicleLinkTest, AllocatesNothingPerFrameAfterWarmUp) {
  config_.message = PoseMessage::kBoth;
  VehicleLink link(config_);
  datagram_.reserve(1024);
  run(link, 200);
  const AllocationCounter counter;
  for (int i = 0; i < 500; ++i) {
    frame_->at += 10ms;
    datagram_.clear();
    link.publish(*frame_, &frame_->bodies[0], 0, frame_->at, datagram_);
  }
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap::mavlink
