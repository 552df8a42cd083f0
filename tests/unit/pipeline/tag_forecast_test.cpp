#include "pipeline/guided_search.hpp"

#include <gtest/gtest.h>

#include "detection/tag_geometry.hpp"
#include "support/allocation_counter.hpp"
#include "unit/estimation/known_motion.hpp"

namespace fiducap {
namespace {

constexpr double kFirstSigma_px = 10;  // before anything was learned

class TagForecastTest : public testing::Test {
 protected:
  TagForecastTest() {
    CameraMount mount;
    mount.model = {
        752, 480, 460, 455, 370, 245, Distortion::kRadialTangential, {-0.28, 0.07, 2e-4, 2e-5, 0}};
    mount.X_BV = {exp_so3({0.1, -0.2, 0.3}), {0.1, 0.02, -0.05}};
    sensors_ = with_imu();
    sensors_.cameras = {mount};
    forecast_.emplace(sensors_, EstimatorConfig{});
  }

  /// A tag at this place of the camera's axes when the body is where the motion has it at t, facing
  /// the camera.
  KnownTag tag_before(double t, const Eigen::Vector3d& p_VT, int id = 3) const {
    const Pose X_VT{exp_so3({M_PI, 0, 0}), p_VT};
    return {id, 0.2, camera_at(t) * X_VT, Matrix6d::Zero()};
  }
  Pose camera_at(double t) const { return Motion::truth(t).X_WB * sensors_.cameras[0].X_BV; }

  void start(double t, double covariance_scale = 0) {
    for (auto at = at_s(t - 0.01); at <= at_s(t + 0.06); at += kImuPeriod)
      forecast_->add_imu(Motion::imu(to_seconds(at - at_s(0))));
    BodyEstimate estimate = Motion::truth(t);
    estimate.covariance = start_covariance(covariance_scale);
    forecast_->set_estimate(estimate);
  }

  std::vector<ExpectedTag> expected(double t, const std::vector<KnownTag>& tags) {
    std::vector<ExpectedTag> out;
    if (!forecast_->aim(0, at_s(t))) return out;
    for (const KnownTag& tag : tags) forecast_->expect(tag, out);
    return out;
  }
  /// Tags that were found without a forecast.
  std::vector<ExpectedTag> strangers(double t) {
    std::vector<ExpectedTag> out;
    EXPECT_TRUE(forecast_->aim(0, at_s(t)));
    forecast_->expect_unforecast(out);
    return out;
  }

  /// An image of the tags at the expected corners, all of them this far off.
  static CornerFrame frame_of(const std::vector<ExpectedTag>& tags, double off_px = 0) {
    CornerFrame frame;
    for (const ExpectedTag& tag : tags) {
      TagSighting sighting;
      sighting.tag_id = tag.tag_id;
      sighting.corners_px = tag.corners_px;
      for (auto& px : sighting.corners_px) px.y() += off_px;
      frame.tags.push_back(sighting);
    }
    return frame;
  }
  /// Forecasts and finds the tags many times. @return the last forecast
  std::vector<ExpectedTag> learn(const std::vector<KnownTag>& tags, double off_px) {
    std::vector<ExpectedTag> now;
    for (int i = 0; i < 60; ++i) {
      now = expected(1.0, tags);
      forecast_->learn(now, frame_of(now, off_px));
    }
    return now;
  }

  BodySensors sensors_;
  std::optional<TagForecast> forecast_;
};

TEST_F(TagForecastTest, GivesTheCornersAtTheInstantOfTheImage) {
  start(1.0);
  const KnownTag tag = tag_before(1.05, {0.3, -0.1, 1.5});
  const auto tags = expected(1.05, {tag});
  ASSERT_EQ(tags.size(), 1u);
  EXPECT_EQ(tags[0].tag_id, 3);
  // Ten IMU steps of this motion are good for some tenths of a millimetre.
  constexpr double kPrediction_px = 0.2;
  for (int i = 0; i < 4; ++i) {
    const auto px = sensors_.cameras[0].model.project(camera_at(1.05).inverse() *
                                                      (tag.X_WT * tag_corner(i, 0.2)));
    EXPECT_LT((tags[0].corners_px[static_cast<std::size_t>(i)] - *px).norm(), kPrediction_px);
  }
}

TEST_F(TagForecastTest, GivesNothingWithoutAnAnchoredEstimate) {
  const KnownTag tag = tag_before(1.0, {0, 0, 1.5});
  EXPECT_TRUE(expected(1.0, {tag}).empty());
  start(1.0);
  EXPECT_FALSE(expected(1.0, {tag}).empty());
  forecast_->clear();
  EXPECT_TRUE(expected(1.0, {tag}).empty());
  BodyEstimate elsewhere = Motion::truth(1.0);
  elsewhere.anchored = false;
  forecast_->set_estimate(elsewhere);
  EXPECT_TRUE(expected(1.0, {tag}).empty());
  start(1.0);
  EXPECT_FALSE(forecast_->aim(1, at_s(1.0))) << "a camera that the body does not have";
  EXPECT_FALSE(forecast_->aim(-1, at_s(1.0)));
}

TEST_F(TagForecastTest, OmitsTagsThatTheCameraCannotSee) {
  start(1.0);
  forecast_->learn(expected(1.0, {}), {});
  KnownTag from_behind = tag_before(1.0, {0, 0, 1.5});
  from_behind.X_WT.q = from_behind.X_WT.q * exp_so3({M_PI, 0, 0});
  KnownTag from_the_side = tag_before(1.0, {0, 0, 1.5});
  from_the_side.X_WT.q = from_the_side.X_WT.q * exp_so3({1.5, 0, 0});
  EXPECT_TRUE(expected(1.0, {from_behind, from_the_side, tag_before(1.0, {0, 0, -1.5}),
                             tag_before(1.0, {0, 0, 0}), tag_before(1.0, {3, 0, 1.5}),
                             tag_before(1.0, {0, 0, 14})})
                  .empty());
}

TEST_F(TagForecastTest, ItsSigmaFollowsTheErrorsOfEarlierForecasts) {
  start(1.0);
  const std::vector<KnownTag> tags{tag_before(1.0, {0, 0, 1.5}, 3),
                                   tag_before(1.0, {0.3, 0, 1.5}, 4),
                                   tag_before(1.0, {-0.3, 0, 1.5}, 5)};
  const auto first = expected(1.0, tags);
  ASSERT_EQ(first.size(), 3u);
  EXPECT_NEAR(first[0].sigma_px, kFirstSigma_px, 0.1);
  auto now = learn(tags, 0.5);
  EXPECT_NEAR(now[0].sigma_px, 1.0, 0.01);
  forecast_->learn(now, frame_of(now, 7.0));
  EXPECT_NEAR(expected(1.0, tags)[0].sigma_px, 7.0, 0.1);
  now = learn(tags, 0.5);
  // One of three that is far away is a wrong id or a moved tag, not a wrong prediction.
  CornerFrame frame = frame_of(now);
  for (auto& px : frame.tags[1].corners_px) px.x() += 200;
  forecast_->learn(now, frame);
  EXPECT_NEAR(expected(1.0, tags)[0].sigma_px, 1.0, 0.01);
}

TEST_F(TagForecastTest, IncludesTheSigmaOfThePosesOnlyForTagsNotSeenBefore) {
  start(1.0, 1.0);  // 1 cm and 0.01 rad
  std::vector<KnownTag> tags{tag_before(1.0, {0, 0, 1.5}, 3), tag_before(1.0, {0.3, 0, 1.5}, 4)};
  learn({tags[0]}, 0.2);
  auto now = expected(1.0, tags);
  ASSERT_EQ(now.size(), 2u);
  EXPECT_NEAR(now[0].sigma_px, 1.0, 0.05);
  const double relative = 460 * std::hypot(0.01 / 1.5, 0.01);
  EXPECT_NEAR(now[1].sigma_px, std::hypot(relative, 0.35), 0.5);
  tags[1].covariance.diagonal().head<3>().setConstant(4.0);
  EXPECT_NEAR(expected(1.0, tags)[1].sigma_px, 15.0, 0.2) << "bounded";
}

TEST_F(TagForecastTest, AnOutageIncreasesTheSigma) {
  start(1.0, 1.0);
  const auto at = [&](double t) { return expected(t, {tag_before(t, {0, 0, 1.5})}); };
  learn({tag_before(1.0, {0, 0, 1.5})}, 0.2);
  const double soon_px = at(1.05)[0].sigma_px;
  EXPECT_GT(at(1.5)[0].sigma_px, 3 * soon_px);
}

TEST_F(TagForecastTest, UsesTheEstimatedExtrinsicsAndLens) {
  start(1.0);
  const KnownTag tag = tag_before(1.0, {0.5, 0, 1.5});
  const auto before = expected(1.0, {tag});
  ExtrinsicsEstimate learned{.X_BV = sensors_.cameras[0].X_BV};
  learned.lens.offset.focal = 0.08;
  forecast_->set_camera(0, learned);
  const auto zoomed = expected(1.0, {tag});
  ASSERT_TRUE(before.size() == 1 && zoomed.size() == 1);
  const Eigen::Vector2d centre(sensors_.cameras[0].model.cu, sensors_.cameras[0].model.cv);
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d expected_px = centre + 1.08 * (before[0].corners_px[i] - centre);
    EXPECT_LT((zoomed[0].corners_px[i] - expected_px).norm(), 1e-9);
  }
  const KnownTag ahead = tag_before(1.0, {0, 0, 1.5});
  forecast_->set_camera(0, {.X_BV = sensors_.cameras[0].X_BV});
  const auto straight = expected(1.0, {ahead});
  forecast_->set_camera(
      0, {.X_BV = sensors_.cameras[0].X_BV * Pose{exp_so3({0, 0.05, 0}), {0, 0, 0}}});
  const auto turned = expected(1.0, {ahead});
  EXPECT_NEAR((turned[0].corners_px[0] - straight[0].corners_px[0]).norm(), 460 * 0.05, 3.0);
}

TEST_F(TagForecastTest, FollowsUnknownTagsAsTheCameraTurns) {
  start(1.0);
  const KnownTag tag = tag_before(1.0, {0.2, 0.1, 4}, 9);
  const auto truth = expected(1.0, {tag});
  ASSERT_EQ(truth.size(), 1u);
  const CornerFrame frame = frame_of(truth);
  ASSERT_TRUE(forecast_->aim(0, at_s(1.0)));
  forecast_->learn({}, frame);
  const auto unknown = strangers(1.05);
  ASSERT_EQ(unknown.size(), 1u);
  EXPECT_EQ(unknown[0].tag_id, 9);
  EXPECT_FALSE(unknown[0].known);
  const auto then = expected(1.05, {tag});
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& px = unknown[0].corners_px[i];
    EXPECT_GT((px - truth[0].corners_px[i]).norm(), 2) << "the camera did not turn";
    EXPECT_LT((px - then[0].corners_px[i]).norm(), 3 * unknown[0].sigma_px);
  }
  // A tag with a forecast is not unknown.
  ASSERT_TRUE(forecast_->aim(0, at_s(1.05)));
  forecast_->learn(then, frame);
  EXPECT_TRUE(strangers(1.1).empty());
}

TEST_F(TagForecastTest, AllocatesNothingAfterWarmUp) {
  const std::vector<KnownTag> tags{tag_before(1.0, {0, 0, 1.5}, 3),
                                   tag_before(1.0, {0.3, 0, 1.5}, 4)};
  std::vector<ExpectedTag> out;
  CornerFrame frame;
  frame.tags.resize(2);
  frame.tags[0].tag_id = 3;
  frame.tags[1].tag_id = 4;
  const BodyEstimate estimate = Motion::truth(1.0);
  const auto image = [&] {
    for (int i = 0; i < 10; ++i) forecast_->add_imu(Motion::imu(1.0 + 0.005 * i));
    forecast_->set_estimate(estimate);
    out.clear();
    if (!forecast_->aim(0, at_s(1.04))) return;
    for (const KnownTag& tag : tags) forecast_->expect(tag, out);
    forecast_->learn(out, frame);
  };
  for (int i = 0; i < 3; ++i) image();
  EXPECT_EQ(out.size(), 2u);
  const AllocationCounter counter;
  for (int i = 0; i < 20; ++i) image();
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap
