#include "streaming/mavlink/vehicle_link.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <map>

#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::mavlink {
namespace {

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
  EXPECT_EQ(clock->doubt, Duration(500us));
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
