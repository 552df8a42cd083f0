#include <gtest/gtest.h>

#include <chrono>

#include "base/pose.hpp"
#include "scene/scene.hpp"
#include "streaming/conventions/frame_sequence.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

class PoseJumpsTest : public testing::Test {
 protected:
  void step(int times = 1) {
    for (int i = 0; i < times; ++i) {
      frame_->at += 10ms;
      body_.X_WP.p += 0.01 * body_.v_WP;
      body_.X_WP.q = (body_.X_WP.q * exp_so3(0.01 * body_.w_WP_P)).normalized();
      jumps_.observe(*frame_);
    }
  }
  /// One frame without the body, one with it.
  void lose_and_find() {
    body_.valid = false;
    step();
    body_.valid = true;
    step();
  }
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"drone", "rover"});
  BodyPose& body_ = frame_->bodies[0];
  PoseJumps jumps_;
};

TEST_F(PoseJumpsTest, FastMotionIsNoJump) {
  body_.v_WP = {20, 0, 0};
  body_.w_WP_P = {0, 0, 15};
  step(100);
  EXPECT_EQ(jumps_.count(0), 0u);
}

TEST_F(PoseJumpsTest, StepTurnAndAlignmentOfTheMapAreOneJumpEach) {
  step();
  body_.X_WP.p.y() += 0.3;
  step(2);
  EXPECT_EQ(jumps_.count(0), 1u);
  EXPECT_EQ(jumps_.count(1), 0u) << "the other body did not move";
  body_.X_WP.q = exp_so3({0, 0, 0.4}) * body_.X_WP.q;
  step();
  EXPECT_EQ(jumps_.count(0), 2u);
  frame_->axes = 1;
  step(2);
  EXPECT_EQ(jumps_.count(0), 3u) << "an alignment counts at any size";
}

TEST_F(PoseJumpsTest, FirstAppearanceIsNoJumpButEachReturnIs) {
  lose_and_find();
  EXPECT_EQ(jumps_.count(0), 0u);
  lose_and_find();
  EXPECT_EQ(jumps_.count(0), 1u);
}

TEST_F(PoseJumpsTest, AnotherBodyAtTheSameIndexStartsAgain) {
  step();
  body_.body_id = 17;
  body_.X_WP.p.x() += 5;
  step();
  EXPECT_EQ(jumps_.count(0), 0u);
}

// As the scene publishes it: in small steps, or invalid for a moment and then elsewhere.
TEST(PoseJumps, CorrectionOfTheMapCountsOnlyWhereThePoseJumps) {
  const auto count = [](double correction_m, double ramp_s) {
    SceneBody body;
    body.description = {1, "drone"};
    body.sensors.imu = ImuNoise{};
    body.ramp.seconds = ramp_s;
    Scene scene({body});
    PoseJumps jumps;
    const auto at_ms = [](int ms) { return instant_from_ns(1'000'000'000) + ms * 1ms; };
    for (int ms = 0; ms < 4000; ms += 10) {
      scene.add_imu(0, {at_ms(ms), Eigen::Vector3d::Zero(), {0, 0, 9.81}});
      if (ms % 50 == 0) {
        BodyEstimate estimate;
        estimate.at = at_ms(ms);
        estimate.covariance = Matrix15d::Identity() * 1e-5;
        estimate.anchored = true;
        if (ms >= 1000) estimate.X_WB.p.x() = correction_m;
        UpdateReport report;
        report.exposed_at = at_ms(ms);
        report.tags_used = 2;
        if (ms == 1000) report.map_shift = estimate.X_WB;
        scene.ingest(0, estimate, report, {}, 0);
      }
      jumps.observe(*scene.sample(at_ms(ms), at_ms(ms), {}, 100.0, nullptr));
    }
    return jumps.count(0);
  };
  EXPECT_EQ(count(0.2, 2), 0u);
  EXPECT_EQ(count(0.5, 2), 1u) << "above the error of a valid pose";
  EXPECT_EQ(count(0.2, 0), 1u);
}

int sent_of(int frames, double frame_rate_hz, double rate_hz) {
  SendSchedule schedule(rate_hz);
  int sent = 0;
  for (int i = 0; i < frames; ++i) {
    const Instant at = instant_from_ns(7) + from_seconds(i / frame_rate_hz);
    sent += schedule.is_due(at, frame_rate_hz) ? 1 : 0;
  }
  return sent;
}

TEST(SendSchedule, MeanRateIsTheRequestedOneUpToTheFrameRate) {
  EXPECT_EQ(sent_of(10'000, 100, 50), 5000);
  EXPECT_NEAR(sent_of(10'000, 100, 30), 3000, 1);
  EXPECT_NEAR(sent_of(10'000, 240, 50), 2083, 1);
  EXPECT_EQ(sent_of(100, 20, 50), 100);
}

TEST(SendSchedule, SendsOneFrameAfterAGap) {
  SendSchedule schedule(10);
  Instant at = instant_from_ns(0);
  EXPECT_TRUE(schedule.is_due(at, 100));
  at += 10s;
  EXPECT_TRUE(schedule.is_due(at, 100));
  EXPECT_FALSE(schedule.is_due(at + 10ms, 100));
  EXPECT_TRUE(schedule.is_due(at + 100ms, 100));
}

}  // namespace
}  // namespace fiducap
