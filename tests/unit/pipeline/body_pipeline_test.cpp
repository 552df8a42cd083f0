#include "pipeline/body_pipeline.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/idle_filter.hpp"

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
  /// 200 readings and 20 images a second.
  void run(BodyPipeline& pipeline, int from_ms, int to_ms, bool with_tag = true) {
    for (int t = from_ms; t < to_ms; t += 5) {
      push(pipeline, imu_at(t));
      if (t % 50 == 0) push(pipeline, frame_at(t, with_tag));
    }
  }
  void work(BodyPipeline& pipeline) {
    while (pipeline.next() != nullptr) {
      if (const BodyUpdate* update = pipeline.take(view_)) {
        ++images_;
        for (const BodyEvent& event : update->events) events_.push_back(event.kind);
        last_ = *update;
      }
    }
  }
  [[nodiscard]] auto count(BodyEvent::Kind kind) const {
    return std::count(events_.begin(), events_.end(), kind);
  }

  PipelineSetup setup_;
  MapView view_{std::make_shared<const TagMap>()};
  std::vector<BodyEvent::Kind> events_;
  std::optional<BodyUpdate> last_;
  int images_{0};
};

TEST_F(BodyPipelineTest, GivesOneUpdatePerImageAndReportsTheAnchoring) {
  BodyPipeline pipeline(setup_);
  run(pipeline, 0, 2000);
  EXPECT_EQ(images_, 40);
  ASSERT_TRUE(last_ && last_->estimate);
  EXPECT_TRUE(last_->estimate->anchored);
  EXPECT_EQ(count(BodyEvent::Kind::kAnchored), 1);
  EXPECT_EQ(count(BodyEvent::Kind::kGaugeShift), 1);
  EXPECT_EQ(pipeline.statistics().frames, 40u);
  EXPECT_EQ(pipeline.statistics().frames_with_pose, 0u) << "poses of a new room are withheld …";
  run(pipeline, 2000, 3000);
  EXPECT_GT(pipeline.statistics().frames_with_pose, 10u) << "… for two seconds";
  EXPECT_LT(pipeline.statistics().frames_with_pose, 20u);
}

TEST_F(BodyPipelineTest, UsesImagesWithoutASilentImuAndReportsIt) {
  for (const int period_ms : {33, 50, 83, 100, 200}) {
    SCOPED_TRACE(period_ms);
    events_.clear();
    BodyPipeline pipeline(setup_);
    run(pipeline, 0, 2000);
    const int before = images_;
    for (int t = 2000; t < 6000; t += period_ms) push(pipeline, frame_at(t));
    ASSERT_TRUE(last_);
    EXPECT_FALSE(last_->withheld);
    // All but those that wait at the end.
    EXPECT_GE(images_ - before, 4000 / period_ms - 9);
    EXPECT_EQ(count(BodyEvent::Kind::kImuSilent), 1);
    run(pipeline, 6000, 7000);
    EXPECT_EQ(count(BodyEvent::Kind::kImuBack), 1);
  }
}

TEST_F(BodyPipelineTest, WithholdsPosesWhileAllReadingsAreOlderThanTheImages) {
  BodyPipeline pipeline(setup_);
  for (int t = 0; t < 6000; t += 5) {
    push(pipeline, imu_at(t));
    const bool jumped = t >= 2000 && t < 4000;
    if (t % 50 == 0 && (t < 4000 || t > 4800)) push(pipeline, frame_at(t + (jumped ? 700 : 0)));
    if (t == 1900 || t == 3900 || t == 5900) {
      ASSERT_TRUE(last_);
      EXPECT_EQ(last_->withheld, t == 3900) << t;
    }
  }
  EXPECT_EQ(count(BodyEvent::Kind::kImuSilent), 1);
  EXPECT_EQ(count(BodyEvent::Kind::kImuBack), 1);
}

TEST_F(BodyPipelineTest, ReportsAnImuInAnotherUnitOnce) {
  BodyPipeline pipeline(setup_);
  for (int t = 0; t < 10'000; t += 5) {
    push(pipeline, ImuSample{ms(t), Eigen::Vector3d::Zero(), {0, 0, 1}});
    if (t % 50 == 0) push(pipeline, frame_at(t));
  }
  EXPECT_EQ(count(BodyEvent::Kind::kImuUnusable), 1);
}

TEST_F(BodyPipelineTest, ReportsOnceThatImagesAreFarTooLate) {
  BodyPipeline pipeline(setup_);
  const auto run_late = [&](int from_ms, int to_ms, int late_ms) {
    for (int t = from_ms; t < to_ms; t += 5) {
      push(pipeline, imu_at(t));
      if (t % 50 == 0) push(pipeline, frame_at(t - late_ms));
    }
  };
  run(pipeline, 0, 2000);
  run_late(2000, 12'000, 1500);
  EXPECT_EQ(count(BodyEvent::Kind::kTurnsDisagree), 1);
  run_late(12'000, 20'000, 0);
  EXPECT_EQ(count(BodyEvent::Kind::kTurnsDisagree), 1);
  run_late(20'000, 30'000, 1500);
  EXPECT_EQ(count(BodyEvent::Kind::kTurnsDisagree), 2) << "another fault of the same kind";
}

TEST_F(BodyPipelineTest, ReportsOnceThatTheMotionIsLost) {
  BodyPipeline pipeline(setup_);
  run(pipeline, 0, 2000);
  run(pipeline, 2000, 12'000, false);
  EXPECT_EQ(count(BodyEvent::Kind::kMotionLost), 1);
  EXPECT_EQ(pipeline.statistics().motion_losses, 1u);
}

TEST_F(BodyPipelineTest, ABodyThatMayNotDefineTheWorkspaceWaits) {
  setup_.gauge.reference_tag.reset();
  view_.may_define_workspace = false;
  BodyPipeline pipeline(setup_);
  run(pipeline, 0, 3000);
  ASSERT_TRUE(last_);
  EXPECT_FALSE(last_->estimate && last_->estimate->anchored);
  EXPECT_EQ(count(BodyEvent::Kind::kAnchored), 0);
}

TEST_F(BodyPipelineTest, LosesNoReadingsThatComeInBursts) {
  constexpr int kBurst_ms = 100;
  setup_.sensors.cameras[0].rate_hz = 60;
  BodyPipeline pipeline(setup_);
  for (int begin = 0; begin < 3000; begin += kBurst_ms) {
    for (int t = begin + 8; t < begin + kBurst_ms; t += 16) push(pipeline, frame_at(t));
    for (int t = begin; t < begin + kBurst_ms; t += 5) push(pipeline, imu_at(t));
  }
  pipeline.finish();
  work(pipeline);
  EXPECT_EQ(pipeline.statistics().merger.late_dropped, 0u);
  EXPECT_EQ(pipeline.statistics().merger.imu_waits_expired, 0u);
  EXPECT_EQ(pipeline.statistics().imu_samples, 600u);
}

/// Returns preset results for tag 4.
class ScriptedFilter final : public IdleFilter<> {
 public:
  struct Script {
    bool anchored{true};
    bool start_is_open{false};
    bool drops{false};
    std::optional<double> own_x{};  ///< Where the filter itself has the tag, metres.
  };
  explicit ScriptedFilter(const Script& script) : script_(script) {}
  UpdateReport update(const TagObservations& seen, const MapKnowledge&) override {
    UpdateReport report;
    at_ = report.exposed_at = seen.exposed_at;
    report.start_is_open = script_.start_is_open;
    if (script_.drops) report.name_dropped(4);
    return report;
  }
  [[nodiscard]] BodyEstimate estimate() const override {
    BodyEstimate estimate;
    estimate.at = at_;
    estimate.anchored = script_.anchored;
    return estimate;
  }
  void tag_beliefs(std::vector<TagBelief>& out) const override {
    out.clear();
    if (!script_.own_x) return;
    out.emplace_back();
    out.back().tag.tag_id = 4;
    out.back().tag.X_WT.p.x() = *script_.own_x;
  }

 private:
  const Script& script_;
  Instant at_{};
};

TEST_F(BodyPipelineTest, OnlyATagAtThePoseOfTheMapContradictsTheMap) {
  TagMap map;
  map.tags.push_back({.tag = {.tag_id = 4, .edge_m = 0.16, .X_WT = {}}});
  view_.map = std::make_shared<const TagMap>(map);
  setup_.sensors.imu.reset();
  const auto contradicted = [&](ScriptedFilter::Script script) {
    BodyPipeline pipeline(setup_, std::make_unique<ScriptedFilter>(script));
    push(pipeline, frame_at(0));
    script.drops = true;
    push(pipeline, frame_at(50));
    return last_->contradicted;
  };
  EXPECT_THAT(contradicted({}), testing::ElementsAre(4));
  EXPECT_THAT(contradicted({.own_x = 0.01}), testing::ElementsAre(4)) << "at the pose of the map";
  EXPECT_THAT(contradicted({.own_x = 0.5}), testing::IsEmpty()) << "its own error";
  EXPECT_THAT(contradicted({.anchored = false}), testing::IsEmpty());
  EXPECT_THAT(contradicted({.start_is_open = true}), testing::IsEmpty());
}

}  // namespace
}  // namespace fiducap
