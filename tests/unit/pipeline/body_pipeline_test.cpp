// A body's pipeline; the outlines of its camera images and why a tag is not used.
#include "pipeline/body_pipeline.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "pipeline/camera_view.hpp"
#include "support/allocation_counter.hpp"
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

TEST_F(BodyPipelineTest, ReportsOnceThatTheMotionIsLost) {
  BodyPipeline pipeline(setup_);
  run(pipeline, 0, 2000);
  run(pipeline, 2000, 12'000, false);
  EXPECT_EQ(count(BodyEvent::Kind::kMotionLost), 1);
  EXPECT_EQ(pipeline.statistics().motion_losses, 1u);
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

/// What the filter returns.
struct FilterResults {
  UpdateReport report;
  std::vector<TagBelief> beliefs;
  std::vector<FoundMismatch> mismatches;
  bool running{true};
  bool anchored{true};
};

class ScriptedFilter final : public IdleFilter<> {
 public:
  explicit ScriptedFilter(FilterResults& results) : results_(results) {}

  UpdateReport update(const TagObservations& seen, const MapKnowledge&) override {
    results_.report.exposed_at = at_ = seen.exposed_at;
    results_.report.running = results_.running;
    return results_.report;
  }
  [[nodiscard]] bool running() const override { return results_.running; }
  [[nodiscard]] BodyEstimate estimate() const override {
    BodyEstimate estimate;
    estimate.at = at_;
    estimate.anchored = results_.anchored;
    estimate.w_WB_B = {0, 0, 1};
    estimate.covariance = Matrix15d::Identity() * 1e-6;
    return estimate;
  }
  void tag_beliefs(std::vector<TagBelief>& out) const override { out = results_.beliefs; }
  void mismatches(std::vector<FoundMismatch>& out) const override { out = results_.mismatches; }

 private:
  FilterResults& results_;
  Instant at_{};
};

TEST_F(BodyPipelineTest, OnlyATagAtThePoseOfTheMapContradictsTheMap) {
  TagMap map;
  map.tags.push_back({.tag = {.tag_id = 4, .edge_m = 0.16, .X_WT = {}}});
  view_.map = std::make_shared<const TagMap>(map);
  setup_.sensors.imu.reset();
  /// @param own_x  where the filter itself has the tag, metres
  const auto contradicted = [&](FilterResults results, std::optional<double> own_x = {}) {
    if (own_x) {
      results.beliefs.emplace_back().tag.tag_id = 4;
      results.beliefs.back().tag.X_WT.p.x() = *own_x;
    }
    BodyPipeline pipeline(setup_, std::make_unique<ScriptedFilter>(results));
    push(pipeline, frame_at(0));
    results.report.name_dropped(4);
    push(pipeline, frame_at(50));
    return last_->contradicted;
  };
  EXPECT_THAT(contradicted({}), testing::ElementsAre(4));
  EXPECT_THAT(contradicted({}, 0.01), testing::ElementsAre(4)) << "at the pose of the map";
  EXPECT_THAT(contradicted({}, 0.5), testing::IsEmpty()) << "its own error";
  EXPECT_THAT(contradicted({.anchored = false}), testing::IsEmpty());
  EXPECT_THAT(contradicted({.report = {.start_is_open = true}}), testing::IsEmpty());
}

class CameraViewTest : public testing::Test {
 protected:
  CameraViewTest() {
    CameraMount mount;
    mount.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    setup_.sensors.cameras = {mount};
  }

  static TagSighting sighting(int id, double u = 300) {
    return {id, 0, 60.0, {{{u, 290}, {u + 100, 290}, {u + 100, 190}, {u, 190}}}, 0.8};
  }
  static KnownTag known(int id) {
    KnownTag tag{id, 0.16, {}};
    tag.X_WT.p = {0, 0, 1};
    tag.X_WT.q = Eigen::Quaterniond(0, 1, 0, 0);
    tag.covariance = Matrix6d::Identity() * 1e-8;
    return tag;
  }
  void in_map(int id, TagState state = TagState::kCalibrated) {
    map_.tags.push_back({known(id), state, 0, 0, 0, 0});
  }
  void own(int id, bool used) {
    results_.beliefs.push_back({known(id), 9, ms(0), used ? ms(1000) : ms(1)});
  }

  /// What an image with these tags shows.
  const CameraView& look(std::vector<TagSighting> tags) {
    BodyPipeline pipeline(setup_, std::make_unique<ScriptedFilter>(results_));
    EXPECT_TRUE(pipeline.push(CornerFrame{0, ms(1000), std::move(tags)}));
    pipeline.finish();
    EXPECT_NE(pipeline.next(), nullptr);
    const MapView view{std::make_shared<const TagMap>(map_)};
    const BodyUpdate* update = pipeline.take(view);
    EXPECT_NE(update, nullptr);
    fill(view_, pipeline, *update, *view.map);
    return view_;
  }
  std::string why(TagSighting tag) {
    const CameraView& view = look({tag});
    return view.outlines.empty() ? "nothing" : std::string(name_of(view.outlines.front().why));
  }

  PipelineSetup setup_;
  FilterResults results_;
  TagMap map_;
  CameraView view_;
};

TEST_F(CameraViewTest, AUsedTagHasItsMarginAndFit) {
  own(4, true);
  results_.report.name_fit({4, 0.3});
  const CameraView& view = look({sighting(4)});
  ASSERT_EQ(view.outlines.size(), 1u);
  const ViewOutline& tag = view.outlines[0];
  EXPECT_EQ(tag.kind, ViewOutline::Kind::kUsed);
  EXPECT_EQ(tag.tag_id, 4);
  EXPECT_EQ(tag.decision_margin, 60);
  EXPECT_EQ(tag.sharpness, 0.8);
  EXPECT_EQ(tag.fit_px, 0.3);
  EXPECT_EQ(tag.corners_px, sighting(4).corners_px);
  EXPECT_EQ(view.width, 752);
  EXPECT_EQ(view.image, nullptr) << "the source gives corners";
}

TEST_F(CameraViewTest, ATagOfTheMapIsUsedWhereItFits) {
  in_map(4);
  results_.report.name_fitting(4);
  EXPECT_EQ(why(sighting(4)), "used");
}

TEST_F(CameraViewTest, NamesWhyASightingCannotBeUsed) {
  setup_.tags.ignore = {4};
  EXPECT_EQ(why(sighting(4)), "ignored");
  TagSighting tag = sighting(5);
  tag.hamming = setup_.tags.max_hamming + 1;
  EXPECT_EQ(why(tag), "corrected_bits");
  tag = sighting(5);
  tag.decision_margin = setup_.detector.min_decision_margin - 1;
  EXPECT_EQ(why(tag), "low_margin");
  tag = sighting(5);  // from behind
  std::swap(tag.corners_px[0], tag.corners_px[1]);
  std::swap(tag.corners_px[2], tag.corners_px[3]);
  EXPECT_EQ(why(tag), "outside_lens");
}

TEST_F(CameraViewTest, NamesBothTagsOfAnIdThatIsSeenTwice) {
  using testing::Field;
  constexpr auto kTwice = UnusedBecause::kIdTwice;
  EXPECT_THAT(
      look({sighting(4, 100), sighting(4, 500), sighting(5)}).outlines,
      testing::ElementsAre(Field(&ViewOutline::why, kTwice), Field(&ViewOutline::why, kTwice),
                           Field(&ViewOutline::why, testing::Ne(kTwice))));
}

TEST_F(CameraViewTest, NamesATagThatFailedTheGateWasDroppedOrIsQuarantined) {
  own(4, false);
  results_.report.tags_rejected = 1;
  EXPECT_EQ(why(sighting(4)), "gate");
  results_.mismatches = {{.kind = FoundMismatch::Kind::kOnePrint, .tag_id = 4, .value = 0.1}};
  EXPECT_EQ(why(sighting(4)), "wrong_size");
  results_.beliefs.clear();
  results_.mismatches.clear();
  in_map(4);
  EXPECT_EQ(why(sighting(4)), "gate") << "also of the map";
  results_.report.name_dropped(4);
  EXPECT_EQ(why(sighting(4)), "moved");
  map_.tags[0].state = TagState::kQuarantined;
  results_.report = {.tags_pending = 1};
  EXPECT_EQ(why(sighting(4)), "quarantined");
}

TEST_F(CameraViewTest, NamesATagThatIsNotInTheState) {
  results_.report.tags_pending = 1;
  EXPECT_EQ(why(sighting(4)), "pending");
  results_.report.tags_pending = 0;
  EXPECT_EQ(why(sighting(4)), "restless");
  results_.running = false;
  EXPECT_EQ(why(sighting(4)), "no_place");
  results_.report.start_is_open = true;
  EXPECT_EQ(why(sighting(4)), "pending") << "until the start is certain";
}

TEST_F(CameraViewTest, TheSpeedOfTheImageIsThatOfTheEstimate) {
  own(4, true);
  // 1 rad/s about the camera's axis: the tag's middle is 25.5 px from it.
  EXPECT_NEAR(look({sighting(4)}).speed_px_s, 25.5, 0.1);
  results_.running = false;
  EXPECT_TRUE(std::isnan(look({sighting(4)}).speed_px_s));
}

TEST_F(CameraViewTest, TheNumberOfOutlinesIsBounded) {
  std::vector<TagSighting> many;
  for (int i = 0; i < 500; ++i) many.push_back(sighting(i, i));
  EXPECT_EQ(look(std::move(many)).outlines.size(), CameraView::kMostOutlines);
}

TEST_F(CameraViewTest, ExpectedTagsAreAtTheForecast) {
  in_map(4);
  in_map(9, TagState::kQuarantined);
  BodyPipeline pipeline(setup_, std::make_unique<ScriptedFilter>(results_));
  const MapView view{std::make_shared<const TagMap>(map_)};
  auto image = std::make_shared<GrayImage>();
  image->resize(752, 480);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(pipeline.push(CameraFrame{0, ms(1000 + 50 * i), image}));
    if (i == 2) pipeline.finish();
    while (pipeline.next() != nullptr)
      if (const BodyUpdate* update = pipeline.take(view)) fill(view_, pipeline, *update, map_);
  }
  ASSERT_EQ(view_.outlines.size(), 1u) << "a quarantined tag is not expected";
  EXPECT_EQ(view_.outlines[0].kind, ViewOutline::Kind::kExpected);
  EXPECT_EQ(view_.outlines[0].tag_id, 4);
  EXPECT_GT(view_.outlines[0].sigma_px, 0);
  const Eigen::Vector2d middle =
      0.5 * (view_.outlines[0].corners_px[0] + view_.outlines[0].corners_px[2]);
  // The body turns slowly about the axis that the tag is on.
  EXPECT_LT((middle - Eigen::Vector2d(375.5, 239.5)).norm(), 1.0);
}

TEST_F(CameraViewTest, AllocatesNothingAfterWarmUp) {
  own(4, true);
  BodyPipeline pipeline(setup_, std::make_unique<ScriptedFilter>(results_));
  ASSERT_TRUE(pipeline.push(CornerFrame{0, ms(1000), {sighting(4), sighting(5)}}));
  pipeline.finish();
  ASSERT_NE(pipeline.next(), nullptr);
  const MapView view{std::make_shared<const TagMap>(map_)};
  const BodyUpdate* update = pipeline.take(view);
  fill(view_, pipeline, *update, map_);
  const AllocationCounter allocations;
  for (int i = 0; i < 10; ++i) fill(view_, pipeline, *update, map_);
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap
