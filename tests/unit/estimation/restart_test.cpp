#include <gtest/gtest.h>

#include "estimation/body_filter.hpp"
#include "example_tags.hpp"

namespace fiducap {
namespace {

/// A body without IMU at rest before three tags.
class Restart : public testing::TestWithParam<const char*> {
 protected:
  Restart() {
    CameraMount mount;
    mount.model = example_camera();
    filter_ = make_body_filter(GetParam(), BodySensors{.cameras = {mount}, .imu = std::nullopt},
                               WorkspaceGauge{}, EstimatorConfig{});
    for (int i = 0; i < 3; ++i) {
      const Pose X_VT{exp_so3({2.6, 0.4, 0.3}), {-0.6 + 0.6 * i, 0.1, 2.0}};
      clean_.tags.push_back(example_observation(i, 0.2, X_VT, example_camera()));
    }
  }

  UpdateReport show(TagObservations seen) {
    seen.exposed_at = now_ += std::chrono::milliseconds(50);
    return filter_->update(seen, {});
  }

  /// Corners that no square can throw.
  [[nodiscard]] TagObservations torn() const {
    TagObservations seen = clean_;
    for (TagObservation& tag : seen.tags)
      for (std::size_t c = 0; c < 4; ++c) tag.corners_px[c].x() += c % 2 == 0 ? 15.0 : -15.0;
    return seen;
  }

  std::unique_ptr<BodyFilter> filter_;
  TagObservations clean_;
  Instant now_{};
};

TEST_P(Restart, ALongContradictionIsDiscardedCompletely) {
  for (int i = 0; i < 20; ++i) show(clean_);
  ASSERT_TRUE(filter_->running());
  for (int i = 0; i < 40; ++i) EXPECT_EQ(show(torn()).tags_used, 0) << "image " << i;
  for (int i = 0; i < 20; ++i) show(clean_);
  ASSERT_TRUE(filter_->running());
  EXPECT_TRUE(filter_->estimate().anchored);
  EXPECT_EQ(filter_->estimate().at, now_);
  EXPECT_EQ(show(clean_).tags_used, 3);
}

INSTANTIATE_TEST_SUITE_P(BothFilters, Restart, testing::Values("robocentric", "world"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace fiducap
