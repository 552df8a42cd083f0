#include "pipeline/body_pipeline.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

ImuSample imu_at(int at_ms) { return {ms(at_ms), Eigen::Vector3d::Zero(), {0, 0, 9.81}}; }

/// A tag of 100 px in the middle of the image, seen from straight ahead by a body at rest.
CornerFrame frame_at(int at_ms, bool with_tag = true) {
  CornerFrame frame{0, ms(at_ms), {}};
  if (with_tag)
    frame.tags.push_back({4, 0, 60.0, {{{326, 290}, {426, 290}, {426, 190}, {326, 190}}}});
  return frame;
}

class BodyPipelineTest : public testing::Test {
 protected:
  BodyPipelineTest() {
    CameraMount mount;
    mount.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    // Camera z along body x, image upright.
    Eigen::Matrix3d R;
    R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    mount.X_BV.q = Eigen::Quaterniond(R);
    setup_.sensors.cameras = {mount};
    setup_.sensors.imu = ImuNoise{};
    setup_.gauge.reference_tag = 4;
    setup_.estimator.branch_evidence = 1e-3;  // one view decides
  }

  /// Pushes a sample and works on all that is due.
  void push(BodyPipeline& pipeline, SensorSample sample) {
    ASSERT_TRUE(pipeline.push(std::move(sample)));
    work(pipeline);
  }
  void work(BodyPipeline& pipeline) {
    while (pipeline.next() != nullptr) {
      if (const BodyUpdate* update = pipeline.take(view_)) {
        ++images_;
        for (const BodyEvent& event : update->events) events_.push_back(event);
        last_ = *update;
      }
    }
  }
  [[nodiscard]] int count(BodyEvent::Kind kind) const {
    return static_cast<int>(std::count_if(events_.begin(), events_.end(),
                                          [&](const BodyEvent& e) { return e.kind == kind; }));
  }

  PipelineSetup setup_;
  MapView view_{std::make_shared<const TagMap>()};
  std::vector<BodyEvent> events_;
  std::optional<BodyUpdate> last_;
  int images_{0};
};

TEST_F(BodyPipelineTest, GivesOneUpdatePerImageAndSaysWhenItIsAnchored) {
  BodyPipeline pipeline(setup_);
  for (int t = 0; t < 2000; t += 5) {
    push(pipeline, imu_at(t));
    if (t % 50 == 0) push(pipeline, frame_at(t));
  }
  EXPECT_EQ(images_, 40);
  ASSERT_TRUE(last_ && last_->estimate);
  EXPECT_TRUE(last_->estimate->anchored);
  EXPECT_EQ(count(BodyEvent::Kind::kAnchored), 1);
  EXPECT_EQ(count(BodyEvent::Kind::kGaugeShift), 1);
  EXPECT_EQ(pipeline.statistics().frames, 40u);
}

TEST_F(BodyPipelineTest, ImagesGoOnWithoutAnImuThatFellSilentAndThatIsSaid) {
  for (const int period_ms : {33, 50, 83, 100, 200}) {
    SCOPED_TRACE(period_ms);
    events_.clear();
    BodyPipeline pipeline(setup_);
    for (int t = 0; t < 2000; t += 5) {
      push(pipeline, imu_at(t));
      if (t % 50 == 0) push(pipeline, frame_at(t));
    }
    const int before = images_;
    for (int t = 2000; t < 6000; t += period_ms) push(pipeline, frame_at(t));
    // All but those that wait at the end.
    EXPECT_GE(images_ - before, 4000 / period_ms - 9);
    EXPECT_EQ(count(BodyEvent::Kind::kImuSilent), 1);
    for (int t = 6000; t < 7000; t += 5) {
      push(pipeline, imu_at(t));
      if (t % 50 == 0) push(pipeline, frame_at(t));
    }
    EXPECT_EQ(count(BodyEvent::Kind::kImuBack), 1);
  }
}

TEST_F(BodyPipelineTest, SaysThatTheMotionIsLostOnce) {
  BodyPipeline pipeline(setup_);
  for (int t = 0; t < 12'000; t += 5) {
    push(pipeline, imu_at(t));
    if (t % 50 == 0) push(pipeline, frame_at(t, t < 2000));
  }
  EXPECT_EQ(count(BodyEvent::Kind::kMotionLost), 1);
  EXPECT_EQ(pipeline.statistics().motion_losses, 1u);
}

TEST_F(BodyPipelineTest, WithoutAReferenceTagABodyThatMayNotDefineTheWorkspaceWaits) {
  setup_.gauge.reference_tag.reset();
  view_.may_define_workspace = false;
  BodyPipeline pipeline(setup_);
  for (int t = 0; t < 3000; t += 5) {
    push(pipeline, imu_at(t));
    if (t % 50 == 0) push(pipeline, frame_at(t));
  }
  ASSERT_TRUE(last_);
  EXPECT_FALSE(last_->estimate && last_->estimate->anchored);
  EXPECT_EQ(count(BodyEvent::Kind::kAnchored), 0);
}

}  // namespace
}  // namespace fiducap
