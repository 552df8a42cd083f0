// Bodies at rest before tags that do not change.
#include <gtest/gtest.h>

#include <cmath>

#include "estimation/body_filter.hpp"
#include "example_room.hpp"
#include "example_tags.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

class AtRest : public BothFilters {
 protected:
  explicit AtRest(bool has_imu = true) {
    CameraMount mount;
    mount.model = example_camera();
    BodySensors sensors{.cameras = {mount}, .imu = {}};
    if (has_imu) sensors.imu = ImuNoise{};
    filter_ = make_body_filter(GetParam(), sensors, WorkspaceGauge{}, EstimatorConfig{});
  }
  void add_tag(const Eigen::Vector3d& p_VT) {
    seen_.tags.push_back(example_observation(static_cast<int>(seen_.tags.size()), 0.2,
                                             {exp_so3({2.6, 0.4, 0.3}), p_VT}, example_camera()));
  }

  std::unique_ptr<BodyFilter> filter_;
  TagObservations seen_;
  Instant now_{};
};

class SteadyLoop : public AtRest {
 protected:
  static constexpr int kTags = 12;

  SteadyLoop() {
    for (int i = 0; i < kTags; ++i) add_tag({-0.6 + 0.3 * (i % 4), -0.4 + 0.4 * (i / 4), 2.0});
  }
  void read(int samples) {
    for (int i = 0; i < samples; ++i) {
      now_ += std::chrono::milliseconds(5);
      filter_->propagate({now_, Eigen::Vector3d::Zero(), {0, 0, 9.81}});
    }
  }
  void run_images(int count) {
    for (int i = 0; i < count; ++i) {
      read(10);
      seen_.exposed_at = now_ - std::chrono::milliseconds(2);
      report_ = filter_->update(seen_, {});
      if (filter_->running()) filter_->tag_beliefs(beliefs_);
    }
  }

  UpdateReport report_;
  std::vector<TagBelief> beliefs_;
};

TEST_P(SteadyLoop, AllocatesNothingAfterWarmUp) {
  run_images(150);  // the start is kept for six seconds
  ASSERT_EQ(report_.tags_used, kTags);
  const AllocationCounter allocations;
  run_images(20);
  EXPECT_EQ(allocations.count(), 0u);
}

TEST_P(SteadyLoop, EstimateIsConstant) {
  run_images(60);
  const BodyEstimate before = filter_->estimate();
  run_images(20);
  const BodyEstimate after = filter_->estimate();
  EXPECT_LT((after.X_WB.p - before.X_WB.p).norm(), 1e-6);
  EXPECT_LT(after.v_WB.norm(), 1e-5);
}

TEST_P(SteadyLoop, ReadingsWithoutImagesDoNotGrowMemory) {
  run_images(60);
  read(1000);
  const AllocationCounter allocations;
  read(5000);
  EXPECT_EQ(allocations.count(), 0u);
}

TEST_P(SteadyLoop, BadReadingsAreIgnored) {
  run_images(60);
  const BodyEstimate before = filter_->estimate();
  filter_->propagate({now_ - std::chrono::seconds(1), {1, 1, 1}, {0, 0, 0}});
  filter_->propagate({now_ + std::chrono::microseconds(1), {std::nan(""), 0, 0}, {0, 0, 9.81}});
  run_images(1);
  EXPECT_LT((filter_->estimate().X_WB.p - before.X_WB.p).norm(), 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Filters, SteadyLoop, kBothFilters, name_of_filter);

class WithoutImu : public AtRest {
 protected:
  WithoutImu() : AtRest(false) {
    for (int i = 0; i < 3; ++i) add_tag({-0.6 + 0.6 * i, 0.1, 2.0});
  }
  UpdateReport show(TagObservations seen) {
    seen.exposed_at = now_ += std::chrono::milliseconds(50);
    return filter_->update(seen, {});
  }
};

TEST_P(WithoutImu, RestartsAfterALongContradiction) {
  TagObservations torn = seen_;  // corners that no square can have
  for (TagObservation& tag : torn.tags)
    for (std::size_t c = 0; c < 4; ++c) tag.corners_px[c].x() += c % 2 == 0 ? 15.0 : -15.0;
  for (int i = 0; i < 20; ++i) show(seen_);
  ASSERT_TRUE(filter_->running());
  for (int i = 0; i < 40; ++i) EXPECT_EQ(show(torn).tags_used, 0) << "image " << i;
  for (int i = 0; i < 20; ++i) show(seen_);
  ASSERT_TRUE(filter_->running());
  EXPECT_TRUE(filter_->estimate().anchored);
  EXPECT_EQ(filter_->estimate().at, now_);
  EXPECT_EQ(show(seen_).tags_used, 3);
}

INSTANTIATE_TEST_SUITE_P(Filters, WithoutImu, kBothFilters, name_of_filter);

}  // namespace
}  // namespace fiducap
