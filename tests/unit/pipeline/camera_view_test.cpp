// Every way in which a tag is not used has its word.
#include "pipeline/camera_view.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

/// Returns preset results.
class TalkingFilter final : public BodyFilter {
 public:
  struct Words {
    UpdateReport report;
    std::vector<TagBelief> beliefs;
    std::vector<FoundMismatch> mismatches;
    bool running{true};
  };
  explicit TalkingFilter(Words& words) : words_(words) {}

  void propagate(const ImuSample&) override {}
  UpdateReport update(const TagObservations& seen, const MapKnowledge&) override {
    words_.report.exposed_at = at_ = seen.exposed_at;
    words_.report.running = words_.running;
    return words_.report;
  }
  void set_tag_priors(std::vector<KnownTag>) override {}
  void lose_motion() override {}
  void release_tag(int) override {}
  [[nodiscard]] bool running() const override { return words_.running; }
  [[nodiscard]] BodyEstimate estimate() const override {
    BodyEstimate estimate;
    estimate.at = at_;
    estimate.anchored = true;
    estimate.w_WB_B = {0, 0, 1};
    estimate.covariance = Matrix15d::Identity() * 1e-6;
    return estimate;
  }
  void tag_beliefs(std::vector<TagBelief>& out) const override { out = words_.beliefs; }
  void mismatches(std::vector<FoundMismatch>& out) const override { out = words_.mismatches; }
  [[nodiscard]] ClockEstimate clock(int) const override { return {}; }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override { return {}; }

 private:
  Words& words_;
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
    words_.beliefs.push_back({known(id), 9, ms(0), used ? ms(1000) : ms(1)});
  }

  /// What an image with these tags shows.
  const CameraView& look(std::vector<TagSighting> tags) {
    BodyPipeline pipeline(setup_, std::make_unique<TalkingFilter>(words_));
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
  TalkingFilter::Words words_;
  TagMap map_;
  CameraView view_;
};

TEST_F(CameraViewTest, AUsedTagHasItsMarginAndItsFit) {
  own(4, true);
  words_.report.name_fit({4, 0.3});
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
  words_.report.name_fitting(4);
  EXPECT_EQ(why(sighting(4)), "used");
}

TEST_F(CameraViewTest, WhatTheSightingItselfForbids) {
  setup_.tags.ignore = {4};
  EXPECT_EQ(why(sighting(4)), "ignored");
  TagSighting tag = sighting(5);
  tag.hamming = setup_.tags.max_hamming + 1;
  EXPECT_EQ(why(tag), "corrected_bits");
  tag = sighting(5);
  tag.decision_margin = setup_.detector.min_decision_margin - 1;
  EXPECT_EQ(why(tag), "low_margin");
}

TEST_F(CameraViewTest, AnIdTwiceInOneImageNamesBoth) {
  const CameraView& view = look({sighting(4, 100), sighting(4, 500), sighting(5)});
  ASSERT_EQ(view.outlines.size(), 3u);
  EXPECT_EQ(view.outlines[0].why, UnusedBecause::kIdTwice);
  EXPECT_EQ(view.outlines[1].why, UnusedBecause::kIdTwice);
  EXPECT_NE(view.outlines[2].why, UnusedBecause::kIdTwice);
}

TEST_F(CameraViewTest, ATagFromBehindIsNone) {
  TagSighting tag = sighting(4);
  std::swap(tag.corners_px[0], tag.corners_px[1]);
  std::swap(tag.corners_px[2], tag.corners_px[3]);
  EXPECT_EQ(why(tag), "outside_lens");
}

TEST_F(CameraViewTest, AQuarantinedTagIsNotUsedWhateverTheFilterSays) {
  in_map(4, TagState::kQuarantined);
  words_.report.tags_pending = 1;
  EXPECT_EQ(why(sighting(4)), "quarantined");
}

TEST_F(CameraViewTest, ATagThatFailedTheGateOfTheFilter) {
  own(4, false);
  words_.report.tags_rejected = 1;
  EXPECT_EQ(why(sighting(4)), "gate");
  words_.mismatches = {{.kind = FoundMismatch::Kind::kOnePrint, .tag_id = 4, .value = 0.1}};
  EXPECT_EQ(why(sighting(4)), "wrong_size");
  words_.beliefs.clear();
  words_.mismatches.clear();
  in_map(4);
  EXPECT_EQ(why(sighting(4)), "gate") << "of the map, too";
}

TEST_F(CameraViewTest, ATagThatWasGivenUp) {
  own(4, false);
  words_.report.tags_rejected = 1;
  words_.report.name_dropped(4);
  EXPECT_EQ(why(sighting(4)), "moved");
}

TEST_F(CameraViewTest, ATagThatWaitsOrIsKeptAwayOrHasNobodyToUseIt) {
  words_.report.tags_pending = 1;
  EXPECT_EQ(why(sighting(4)), "pending");
  words_.report.tags_pending = 0;
  EXPECT_EQ(why(sighting(4)), "restless");
  words_.running = false;
  EXPECT_EQ(why(sighting(4)), "no_place");
  words_.report.start_is_open = true;
  EXPECT_EQ(why(sighting(4)), "pending") << "until the start is certain";
}

TEST_F(CameraViewTest, TellsHowFastTheImageMovesByTheEstimate) {
  own(4, true);
  // 1 rad/s about the camera's own axis: the tag's middle is 25.5 px from it.
  EXPECT_NEAR(look({sighting(4)}).speed_px_s, 25.5, 0.1);
  words_.running = false;
  EXPECT_TRUE(std::isnan(look({sighting(4)}).speed_px_s));
}

TEST_F(CameraViewTest, ShowsNoMoreOutlinesThanItsBound) {
  std::vector<TagSighting> many;
  for (int i = 0; i < 500; ++i) many.push_back(sighting(i, i));
  EXPECT_EQ(look(std::move(many)).outlines.size(), CameraView::kMostOutlines);
}

TEST_F(CameraViewTest, ExpectedTagsStandWhereTheForecastHasThem) {
  in_map(4);
  in_map(9, TagState::kQuarantined);
  BodyPipeline pipeline(setup_, std::make_unique<TalkingFilter>(words_));
  const MapView view{std::make_shared<const TagMap>(map_)};
  auto image = std::make_shared<GrayImage>();
  image->resize(752, 480);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(pipeline.push(CameraFrame{0, ms(1000 + 50 * i), image}));
    if (i == 2) pipeline.finish();
    while (pipeline.next() != nullptr)
      if (const BodyUpdate* update = pipeline.take(view)) fill(view_, pipeline, *update, map_);
  }
  ASSERT_EQ(view_.outlines.size(), 1u) << "nobody looks for a quarantined tag";
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
  BodyPipeline pipeline(setup_, std::make_unique<TalkingFilter>(words_));
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
