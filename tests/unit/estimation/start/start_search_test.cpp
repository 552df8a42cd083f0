// A start that is followed again from other hypotheses: the selected one, and the cost.
#include <gtest/gtest.h>

#include <algorithm>

#include "estimation/start/start_search.hpp"
#include "support/idle_filter.hpp"

namespace fiducap {
namespace {

constexpr int kTagsInView = 5;
constexpr Duration kImagePeriod = std::chrono::milliseconds(50);
// An image of five tags and ten readings is nine and a half of the 800 units of work that go with
// each image; and the one that is under way.
constexpr int kMostPerImage = (800 / 9 + 1) * (kTagsInView + 1);

/// The clock is off by `truth_s`; a filter that starts from another shift pays for the difference
/// and finds half of it, if it is free to.
struct World {
  double truth_s{0.0};
  double floor{0.0};    ///< Cost per number that no clock explains.
  int sightings{0};     ///< Shown to trial filters so far …
  int filters{0};       ///< … the number of them now …
  int most_filters{0};  ///< … and were at most.
};

class FakeFilter final : public IdleFilter<StartingFilter> {
 public:
  FakeFilter(World& world, ClockHypothesis clocks) : world_(world), clocks_(std::move(clocks)) {
    world_.most_filters = std::max(world_.most_filters, ++world_.filters);
  }
  ~FakeFilter() override { --world_.filters; }
  FakeFilter(const FakeFilter&) = delete;
  FakeFilter& operator=(const FakeFilter&) = delete;

  void propagate(const ImuSample& imu) override { newest_imu = imu.sampled_at; }
  UpdateReport update(const TagObservations& seen, const MapKnowledge&) override {
    world_.sightings += static_cast<int>(seen.tags.size()) + 1;
    has_image_ = true;
    newest_image = seen.exposed_at - seen.clock_shift;
    return {};
  }
  [[nodiscard]] ClockEstimate clock(int) const override {
    const double off_s = world_.truth_s - clocks_.shifts_s[0];
    return {.shift_s = clocks_.shifts_s[0] + (clocks_.spread > 0 ? 0.5 * off_s : 0.0),
            .shift_sigma_s = 1e-4};
  }
  [[nodiscard]] Explanation explain(const TagObservations& seen,
                                    const UpdateReport&) const override {
    const double off_s = world_.truth_s - clock(0).shift_s;
    const auto tags = static_cast<double>(seen.tags.size());
    return {tags * (8.0 + world_.floor + 1e5 * off_s * off_s), 8.0 * tags};
  }
  [[nodiscard]] bool is_following() const override { return has_image_; }
  [[nodiscard]] int contradicting_images() const override { return contradicting; }
  [[nodiscard]] InitialisationPriors initialisation_priors() const override { return priors; }
  void begin_with(const InitialisationPriors& begun) override { priors = begun; }
  void end_start() override { ++ends; }
  [[nodiscard]] Axes axes() const override { return {}; }
  [[nodiscard]] int generation() const override { return 1; }
  void set_generation(int) override {}
  void set_restart_clocks(ClockHypothesis) override {}

  int contradicting{0};
  InitialisationPriors priors{.sensors = {}, .corners_px = {0.4}, .wrong = {}};
  int ends{0};
  Instant newest_image{};
  Instant newest_imu{};

 private:
  World& world_;
  ClockHypothesis clocks_;
  bool has_image_{false};
};

class StartSearchTest : public testing::Test {
 protected:
  /// The next image and the readings before it. @return sightings shown to trial filters with it
  int show() {
    for (int i = 0; i < 10; ++i) {
      const ImuSample imu{now_ += kImagePeriod / 10, {0, 0, 0}, {0, 0, 9.81}};
      search_.add(imu);
      present_->propagate(imu);
    }
    TagObservations seen;
    seen.exposed_at = now_;
    seen.tags.resize(kTagsInView);
    present_->update(seen, {});
    const int before = world_.sightings;
    if (auto better = search_.add(seen, {}, *present_)) {
      present_.reset(static_cast<FakeFilter*>(better->filter.release()));
      ++taken_over_;
      EXPECT_EQ(present_->newest_image, now_) << "has processed the present image";
      EXPECT_EQ(present_->newest_imu, now_);
    }
    return world_.sightings - before;
  }
  /// Images until the search ends, and a trial filter was selected.
  void finish() {
    for (int i = 0; i < 300 && search_.is_open(); ++i) show();
    EXPECT_GE(taken_over_, 1);
  }

  World world_;
  Instant now_{std::chrono::seconds(100)};
  StartSearch search_{{{0.0}, {0.02}},
                      true,
                      [this](const ClockHypothesis& clocks) {
                        return std::make_unique<FakeFilter>(world_, clocks);
                      },
                      [this](const StartLog&) { return std::vector{by_rotations_s_}; }};
  double by_rotations_s_{0.0};
  std::unique_ptr<FakeFilter> present_{
      std::make_unique<FakeFilter>(world_, ClockHypothesis{{0.0}, 1.0})};
  int taken_over_{0};
};

TEST_F(StartSearchTest, FindsTheClockAndEnds) {
  world_.truth_s = 0.05;
  finish();
  EXPECT_FALSE(search_.is_open());
  EXPECT_NEAR(present_->clock(0).shift_s, world_.truth_s, 0.005);
  EXPECT_EQ(present_->ends, 1);
}

TEST_F(StartSearchTest, ATrialStartsWithTheLearnedNoiseAndTheFoundMismatches) {
  present_->priors.sensors.applied = {25.0, 1e-6};
  present_->priors.wrong = {{FoundMismatch::Kind::kFocalLength, 0}};
  finish();
  EXPECT_EQ(present_->priors.sensors.applied, Eigen::Vector2d(25.0, 1e-6));
  ASSERT_EQ(present_->priors.wrong.size(), 1u);
  EXPECT_EQ(present_->priors.wrong.front().kind, FoundMismatch::Kind::kFocalLength);
  EXPECT_EQ(present_->priors.wrong.front().camera, 0);
}

TEST_F(StartSearchTest, MismatchesAndNoiseLearnedWithAnotherClockAreDiscarded) {
  world_.truth_s = 0.05;
  present_->priors.wrong = {{FoundMismatch::Kind::kFocalLength, 0}};
  present_->priors.sensors.applied = {25.0, 1e-6};
  present_->priors.corners_px = {0.03};
  finish();
  EXPECT_TRUE(present_->priors.wrong.empty());
  EXPECT_EQ(present_->priors.sensors.applied, Eigen::Vector2d(1.0, 0.0));
  EXPECT_EQ(present_->priors.corners_px, std::vector<double>{0.03}) << "but not that of corners";
}

TEST_F(StartSearchTest, IsOpenForLongerWhileTheImuMayBeNoisier) {
  const Instant begin = now_;
  while (now_ - begin < std::chrono::seconds(5)) show();
  present_->priors.sensors.derivative(0) = 30;
  present_->priors.sensors.information(0, 0) = 100;  // 3 sigma, and not yet applied
  while (now_ - begin < std::chrono::seconds(9)) show();
  ASSERT_TRUE(search_.is_open());
  const int before = taken_over_;
  present_->priors.sensors.applied(0) = 16;
  finish();
  EXPECT_LT(now_ - begin, std::chrono::seconds(15));
  EXPECT_GT(taken_over_, before);
  EXPECT_EQ(present_->priors.sensors.applied(0), 16) << "followed again with it";
}

TEST_F(StartSearchTest, TheSightingsPerImageAreBounded) {
  world_.truth_s = 0.07;
  world_.floor = 6.0;  // a bad fit: everything is tried
  int most = 0;
  int images = 0;
  for (; images < 400 && search_.is_open(); ++images) most = std::max(most, show());
  EXPECT_LE(most, kMostPerImage);
  EXPECT_GT(most, kMostPerImage / 2);
  EXPECT_LT(images, 300) << "fifteen seconds";
  EXPECT_LE(world_.most_filters, 3) << "present, best and trial filter";
}

TEST_F(StartSearchTest, EndsWhenTheLogIsFull) {
  present_->contradicting = 0;
  for (int i = 0; i < 20; ++i) show();
  TagObservations seen;
  seen.tags.resize(500);
  int images = 0;
  for (; images < 100 && search_.is_open(); ++images) {
    seen.exposed_at = now_ += std::chrono::milliseconds(1);
    (void)search_.add(seen, {}, *present_);
  }
  EXPECT_LT(images, 25);
  EXPECT_EQ(present_->ends, 1);
}

TEST_F(StartSearchTest, ContradictionsAreProcessedAtOnce) {
  for (int i = 0; i < 10; ++i) EXPECT_EQ(show(), 0);
  present_->contradicting = 5;
  EXPECT_GT(show(), 0);
}

TEST_F(StartSearchTest, TriesTheOffsetByRotationsWhenNothingElseFits) {
  world_.truth_s = 0.1;
  by_rotations_s_ = 0.096;
  finish();
  EXPECT_NEAR(present_->clock(0).shift_s, world_.truth_s, 0.003);
}

TEST(HypothesisPlanTest, TriesOnlyTheConfiguredClockWhenItFits) {
  const std::vector<ClockEstimate> present{{.shift_s = 0.001, .shift_sigma_s = 0.001}};
  HypothesisPlan plan({{0.0}, {0.02}}, present);
  std::vector<double> spreads;
  while (const auto hypothesis = plan.next()) {
    spreads.push_back(hypothesis->spread);
    EXPECT_EQ(hypothesis->shifts_s, std::vector<double>{0.0});
    (void)plan.take({{1000.0, 1000.0}, {{.shift_s = 0.001, .shift_sigma_s = 0.001}}});
    EXPECT_FALSE(plan.needs_rotations());
  }
  EXPECT_EQ(spreads, (std::vector<double>{1.0, 0.0}));
}

TEST(HypothesisPlanTest, SelectsTheLowestCostWhenNothingFits) {
  constexpr double kTruth_s = -0.037;
  HypothesisPlan plan({{0.0}, {0.02}}, std::vector<ClockEstimate>{{}});
  ClockHypothesis best;
  int tried = 0;
  while (const auto hypothesis = plan.next()) {
    const double off_s = hypothesis->shifts_s[0] - kTruth_s;
    const HypothesisPlan::Outcome outcome{{1500.0 + 3e6 * off_s * off_s, 1000.0},
                                          {{.shift_s = hypothesis->shifts_s[0]}}};
    if (plan.take(outcome)) best = *hypothesis;
    if (plan.needs_rotations()) plan.add_rotations({-0.036});
    ASSERT_LT(++tried, 5);
  }
  EXPECT_EQ(best.shifts_s, std::vector<double>{-0.036});
}

}  // namespace
}  // namespace fiducap
