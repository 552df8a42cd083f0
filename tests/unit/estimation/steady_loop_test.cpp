#include <gtest/gtest.h>

#include "capture/sample_merger.hpp"
#include "estimation/body_filter.hpp"
#include "example_tags.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

constexpr int kTags = 12;

/// A body at rest that sees the same tags in every image.
class SteadyLoop : public testing::TestWithParam<const char*> {
 protected:
  SteadyLoop() {
    BodySensors sensors;
    CameraMount mount;
    mount.model = example_camera();
    sensors.cameras = {mount};
    sensors.imu = ImuNoise{};
    filter_ = make_body_filter(GetParam(), sensors, WorkspaceGauge{}, EstimatorConfig{});
    for (int i = 0; i < kTags; ++i) {
      const Pose X_VT{exp_so3({2.6, 0.4, 0.3}), {-0.6 + 0.3 * (i % 4), -0.4 + 0.4 * (i / 4), 2.0}};
      seen_.tags.push_back(example_observation(i, 0.2, X_VT, example_camera()));
    }
  }

  void run_image() {
    for (int i = 0; i < 10; ++i) {
      now_ += std::chrono::milliseconds(5);
      filter_->propagate({now_, Eigen::Vector3d::Zero(), {0, 0, 9.81}});
    }
    seen_.exposed_at = now_ - std::chrono::milliseconds(2);
    report_ = filter_->update(seen_, {});
    if (filter_->running()) filter_->tag_beliefs(beliefs_);
  }

  std::unique_ptr<BodyFilter> filter_;
  TagObservations seen_;
  UpdateReport report_;
  std::vector<TagBelief> beliefs_;
  Instant now_{};
};

TEST_P(SteadyLoop, AllocatesNothingAfterWarmUp) {
  for (int i = 0; i < 150; ++i) run_image();  // the start is kept for six seconds
  ASSERT_EQ(report_.tags_used, kTags);
  const AllocationCounter allocations;
  for (int i = 0; i < 20; ++i) run_image();
  EXPECT_EQ(allocations.count(), 0u);
}

TEST_P(SteadyLoop, EstimateIsConstantForABodyAtRest) {
  for (int i = 0; i < 60; ++i) run_image();
  const BodyEstimate before = filter_->estimate();
  for (int i = 0; i < 20; ++i) run_image();
  const BodyEstimate after = filter_->estimate();
  EXPECT_LT((after.X_WB.p - before.X_WB.p).norm(), 1e-6);
  EXPECT_LT(after.v_WB.norm(), 1e-5);
}

TEST_P(SteadyLoop, ReadingsThatNeverEndInAnImageDoNotGrowMemory) {
  for (int i = 0; i < 60; ++i) run_image();
  for (int i = 0; i < 1000; ++i)
    filter_->propagate(
        {now_ += std::chrono::milliseconds(5), Eigen::Vector3d::Zero(), {0, 0, 9.81}});
  const AllocationCounter allocations;
  for (int i = 0; i < 5000; ++i)
    filter_->propagate(
        {now_ += std::chrono::milliseconds(5), Eigen::Vector3d::Zero(), {0, 0, 9.81}});
  EXPECT_EQ(allocations.count(), 0u);
}

TEST_P(SteadyLoop, BadReadingsAreIgnored) {
  for (int i = 0; i < 60; ++i) run_image();
  const BodyEstimate before = filter_->estimate();
  filter_->propagate({now_ - std::chrono::seconds(1), {1, 1, 1}, {0, 0, 0}});
  filter_->propagate({now_ + std::chrono::microseconds(1), {std::nan(""), 0, 0}, {0, 0, 9.81}});
  run_image();
  EXPECT_LT((filter_->estimate().X_WB.p - before.X_WB.p).norm(), 1e-5);
}

INSTANTIATE_TEST_SUITE_P(BothFilters, SteadyLoop, testing::Values("robocentric", "world"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace fiducap
