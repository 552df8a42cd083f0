// The outlines of a camera image and why a tag is not used.
#include "pipeline/camera_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/allocation_counter.hpp"
#include "support/idle_filter.hpp"

namespace fiducap {
namespace {

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

/// What the filter returns.
struct FilterResults {
  UpdateReport report;
  std::vector<TagBelief> beliefs;
  std::vector<FoundMismatch> mismatches;
  bool running{true};
};

class ScriptedViewFilter final : public IdleFilter<> {
 public:
  explicit ScriptedViewFilter(FilterResults& results) : results_(results) {}

  UpdateReport update(const TagObservations& seen, const MapKnowledge&) override {
    results_.report.exposed_at = at_ = seen.exposed_at;
    results_.report.running = results_.running;
    return results_.report;
  }
  [[nodiscard]] bool running() const override { return results_.running; }
  [[nodiscard]] BodyEstimate estimate() const override {
    BodyEstimate estimate;
    estimate.at = at_;
    estimate.anchored = true;
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
    BodyPipeline pipeline(setup_, std::make_unique<ScriptedViewFilter>(results_));
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

TEST_F(CameraViewTest, AQuarantinedTagIsNotUsed) {
  in_map(4, TagState::kQuarantined);
  results_.report.tags_pending = 1;
  EXPECT_EQ(why(sighting(4)), "quarantined");
}

TEST_F(CameraViewTest, NamesATagThatFailedTheGate) {
  own(4, false);
  results_.report.tags_rejected = 1;
  EXPECT_EQ(why(sighting(4)), "gate");
  results_.mismatches = {{.kind = FoundMismatch::Kind::kOnePrint, .tag_id = 4, .value = 0.1}};
  EXPECT_EQ(why(sighting(4)), "wrong_size");
  results_.beliefs.clear();
  results_.mismatches.clear();
  in_map(4);
  EXPECT_EQ(why(sighting(4)), "gate") << "also of the map";
}

TEST_F(CameraViewTest, NamesADroppedTag) {
  own(4, false);
  results_.report.tags_rejected = 1;
  results_.report.name_dropped(4);
  EXPECT_EQ(why(sighting(4)), "moved");
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
  BodyPipeline pipeline(setup_, std::make_unique<ScriptedViewFilter>(results_));
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
  BodyPipeline pipeline(setup_, std::make_unique<ScriptedViewFilter>(results_));
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
