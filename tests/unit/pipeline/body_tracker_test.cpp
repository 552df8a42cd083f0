#include "pipeline/body_tracker.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "base/pose.hpp"
#include "pipeline/body_pose.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

Instant at_ms(int ms) { return instant_from_ns(1'000'000'000) + std::chrono::milliseconds(ms); }

/// A body with IMU at rest at (1, 2, 3), images every 50 ms, as a worker would feed it.
class BodyTrackerTest : public testing::Test {
 protected:
  BodyTrackerTest() : tracker_(7, Pose{}, BodyLimits{}, sensors(), EstimatorConfig{}) {}

  static BodySensors sensors() {
    BodySensors s;
    s.imu = ImuNoise{};
    return s;
  }
  static BodyEstimate estimate(int ms, bool anchored = true) {
    BodyEstimate e;
    e.at = at_ms(ms);
    e.X_WB.p = {1, 2, 3};
    e.covariance = Matrix15d::Identity() * 1e-6;
    e.anchored = anchored;
    return e;
  }
  static UpdateReport report(int ms, int used) {
    UpdateReport r;
    r.exposed_at = at_ms(ms);
    r.tags_seen = r.tags_used = used;
    r.reprojection_px = used > 0 ? 0.4 : 0.0;
    r.running = true;
    return r;
  }
  void rest_until(int ms, const Vector3d& rate = Vector3d::Zero()) {
    for (; imu_ms_ <= ms; imu_ms_ += 5) tracker_.add_imu({at_ms(imu_ms_), rate, {0, 0, 9.81}});
  }
  void image(int ms, int used, std::uint64_t dropped = 0) {
    rest_until(ms);
    tracker_.ingest(estimate(ms), report(ms, used), std::chrono::milliseconds(8), dropped);
  }
  void ingest(const std::optional<BodyEstimate>& e, const UpdateReport& r) {
    tracker_.ingest(e, r, {}, 0);
  }
  BodyPose sample(int ms) {
    BodyPose pose;
    pose.tags_in_view = 99;  // left in a reused frame
    tracker_.sample(at_ms(ms), pose);
    return pose;
  }
  BodyState state(int ms) { return sample(ms).state; }

  BodyTracker tracker_;
  int imu_ms_{0};
};

TEST_F(BodyTrackerTest, SearchesUntilTheFirstImage) {
  rest_until(100);
  const auto pose = sample(100);
  EXPECT_EQ(pose.body_id, 7);
  EXPECT_EQ(pose.state, BodyState::kSearching);
  EXPECT_FALSE(pose.valid);
  EXPECT_EQ(pose.tags_in_view, 0);
  EXPECT_EQ(pose.age, Duration{0});
}

TEST_F(BodyTrackerTest, TracksWithAUsedTag) {
  image(100, 3, 5);
  const auto pose = sample(110);
  EXPECT_EQ(pose.state, BodyState::kTracking);
  EXPECT_TRUE(pose.valid);
  EXPECT_LT((pose.X_WP.p - Vector3d(1, 2, 3)).norm(), 1e-9);
  EXPECT_EQ(pose.tags_in_view, 3);
  EXPECT_EQ(pose.age, std::chrono::milliseconds(10));
  EXPECT_EQ(pose.exposed_at, at_ms(100));
  EXPECT_EQ(pose.processing, std::chrono::milliseconds(8));
  EXPECT_EQ(pose.images_dropped, 5u);
  EXPECT_EQ(pose.reprojection_px, 0.4);
  EXPECT_GT(pose.position_sigma_m(), 0);
}

TEST_F(BodyTrackerTest, IsNotValidUntilItIsAnchored) {
  rest_until(100);
  ingest(estimate(100, false), report(100, 2));
  const auto pose = sample(105);
  EXPECT_EQ(pose.state, BodyState::kSearching);
  EXPECT_FALSE(pose.valid);
  EXPECT_EQ(pose.X_WP.p, Vector3d::Zero()) << "not even as history";
  EXPECT_TRUE(pose.covariance.isZero());
  image(150, 2);
  EXPECT_TRUE(sample(155).valid);
}

TEST_F(BodyTrackerTest, LandmarksKeepItCoastingButDoNotMakeItTrack) {
  const auto image_of_landmarks = [&](int ms, int landmarks) {
    rest_until(ms);
    UpdateReport r = report(ms, 0);
    r.landmarks_used = landmarks;
    ingest(estimate(ms), r);
  };
  image_of_landmarks(50, 9);
  EXPECT_EQ(state(50), BodyState::kSearching);
  image(100, 3);
  for (int ms = 150; ms <= 7000; ms += 50) image_of_landmarks(ms, ms % 200 == 0 ? 9 : 0);
  EXPECT_EQ(state(7000), BodyState::kCoasting);
  EXPECT_EQ(sample(7000).age, std::chrono::milliseconds(6900));
  for (int ms = 7050; ms <= 12200; ms += 50) image_of_landmarks(ms, 1);  // too few
  EXPECT_EQ(state(12200), BodyState::kLost);
}

TEST_F(BodyTrackerTest, CoastsWithoutTagsAndTracksAgain) {
  image(100, 3);
  for (int ms = 150; ms <= 300; ms += 50) image(ms, 0);
  EXPECT_EQ(state(245), BodyState::kTracking);
  const auto pose = sample(300);
  EXPECT_EQ(pose.state, BodyState::kCoasting);
  EXPECT_TRUE(pose.valid);
  EXPECT_EQ(pose.tags_in_view, 0);
  EXPECT_EQ(pose.age, std::chrono::milliseconds(200));
  EXPECT_EQ(pose.exposed_at, at_ms(300));
  image(350, 1);
  EXPECT_EQ(state(350), BodyState::kTracking);
}

TEST_F(BodyTrackerTest, DoesNotCoastBeforeItsFirstPose) {
  rest_until(100);
  BodyEstimate vague = estimate(100);
  vague.covariance *= 1e6;
  ingest(vague, report(100, 3));
  EXPECT_EQ(state(110), BodyState::kTracking);
  EXPECT_EQ(state(400), BodyState::kSearching) << "no pose was valid";
  image(450, 3);
  EXPECT_EQ(state(700), BodyState::kCoasting);
}

TEST_F(BodyTrackerTest, ASigmaAboveItsLimitIsNotValid) {
  struct Case {
    int element;
    double sigma;
    bool valid;
  };
  rest_until(100);
  for (const auto& [element, sigma, valid] :
       {Case{1, 0.26, false}, {5, 0.21, false}, {5, 0.19, true}}) {
    auto vague = estimate(100);
    vague.covariance(element, element) = sigma * sigma;
    ingest(vague, report(100, 1));
    EXPECT_EQ(sample(101).valid, valid) << sigma;
    EXPECT_EQ(state(101), BodyState::kTracking);
  }
}

TEST_F(BodyTrackerTest, ImpossibleNumbersAreNotValid) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  rest_until(100);
  std::array<BodyEstimate, 3> broken{estimate(100), estimate(100), estimate(100)};
  broken[0].X_WB.p.y() = kNaN;
  broken[1].covariance(0, 0) = kNaN;
  broken[2].covariance(0, 0) = -1.0;
  for (const BodyEstimate& e : broken) {
    ingest(e, report(100, 1));
    EXPECT_FALSE(sample(101).valid);
  }
}

TEST_F(BodyTrackerTest, IsNotValidLongBeforeItIsLost) {
  image(100, 3);
  rest_until(4900);
  const auto pose = sample(4900);
  EXPECT_EQ(pose.state, BodyState::kCoasting);
  EXPECT_EQ(pose.tags_in_view, 0);
  EXPECT_GT(pose.position_sigma_m(), BodyLimits{}.max_position_sigma_m);
  EXPECT_FALSE(pose.valid);
}

TEST_F(BodyTrackerTest, IsLostAfterFiveSecondsAtItsLastSeenPosition) {
  image(100, 3);
  rest_until(2000);
  rest_until(5199, {1, 0, 9.81});
  EXPECT_EQ(state(5099), BodyState::kCoasting);
  const auto pose = sample(5101);
  EXPECT_EQ(pose.state, BodyState::kLost);
  EXPECT_FALSE(pose.valid);
  EXPECT_EQ(pose.X_WP.p, Vector3d(1, 2, 3));
  EXPECT_EQ(pose.age, std::chrono::milliseconds(5001));
}

TEST_F(BodyTrackerTest, StaysLostUntilATagIsUsed) {
  image(100, 3);
  ingest(std::nullopt, report(5150, 0));  // the filter has lost the motion
  EXPECT_EQ(state(5200), BodyState::kLost);
  ingest(estimate(5250, false), report(5250, 0));  // runs by gravity, without a tag
  EXPECT_EQ(state(5300), BodyState::kLost);
  imu_ms_ = 5300;
  image(5350, 2);
  EXPECT_EQ(state(5400), BodyState::kTracking);
  EXPECT_TRUE(sample(5400).valid);
}

TEST_F(BodyTrackerTest, IsLostWithTheMotionOfItsFilter) {
  image(100, 3);
  ingest(std::nullopt, report(400, 0));
  EXPECT_EQ(state(400), BodyState::kLost);
  EXPECT_FALSE(sample(400).valid);
  EXPECT_EQ(sample(400).X_WP.p, Vector3d(1, 2, 3));
  imu_ms_ = 405;
  image(450, 3);
  EXPECT_EQ(state(450), BodyState::kTracking);
}

TEST_F(BodyTrackerTest, TheLastSeenPositionMovesWithTheWorkspaceUntilAReset) {
  image(100, 3);
  UpdateReport shifted = report(400, 0);
  shifted.gauge_shift = Pose{Eigen::Quaterniond::Identity(), {10, 0, 0}};
  ingest(std::nullopt, shifted);
  EXPECT_EQ(sample(400).X_WP.p, Vector3d(11, 2, 3));
  shifted.generation = 1;
  ingest(std::nullopt, shifted);
  EXPECT_EQ(sample(400).X_WP.p, Vector3d(11, 2, 3));
}

TEST_F(BodyTrackerTest, IsLostWithItsSourceUntilTheNextImage) {
  image(100, 3);
  tracker_.source_lost();
  EXPECT_EQ(state(101), BodyState::kLost);
  EXPECT_FALSE(sample(101).valid);
  image(150, 3);
  EXPECT_EQ(state(151), BodyState::kTracking);
}

TEST_F(BodyTrackerTest, TheImageRateIsSmoothAndFallsWithoutImages) {
  for (int i = 0; i < 40; ++i) image(100 + 50 * i + (i % 2) * 6, 1);
  EXPECT_NEAR(sample(2060).image_rate_hz, 20.0, 0.5);
  EXPECT_NEAR(sample(2056 + 500).image_rate_hz, 2.0, 0.1);
  for (int i = 0; i < 10; ++i) image(10'000 + 100 * i, 1);
  EXPECT_NEAR(sample(10'900).image_rate_hz, 10.0, 0.1) << "the pause has no influence";
}

TEST(BodyLimits, NamesEveryBrokenRule) {
  EXPECT_TRUE(BodyLimits{}.check("limits.").empty());
  BodyLimits limits;
  limits.max_position_sigma_m = -1;
  limits.lose_after_s = 0.1;
  const auto errors = limits.check("bodies.robot.limits.");
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_EQ(errors[0].text(),
            "bodies.robot.limits.max_position_sigma_m = -1: must be finite and > 0");
  EXPECT_EQ(errors[1].path, "bodies.robot.limits.lose_after_s");
}

constexpr double kPivotRounding = 1e-12;

BodyEstimate turning_body() {
  BodyEstimate body;
  body.X_WB = {exp_so3({0.2, -0.4, 0.9}), {1, -2, 0.5}};
  body.v_WB = {0.3, 0.1, -0.2};
  body.w_WB_B = {0.5, -1.0, 2.0};
  body.a_WB = {0.1, 0.2, 0.3};
  return body;
}

const Pose kPivot{exp_so3({0.1, 0.7, -0.3}), {0.2, -0.1, 0.05}};

// A steady turn about z: every part can be written down by hand.
TEST(Pivot, HasTheVelocityAndCentripetalAccelerationOfARotation) {
  BodyEstimate body;
  body.X_WB.q = exp_so3({0, 0, M_PI / 2});
  body.w_WB_B = {0, 0, 2};
  BodyPose out;
  write_pivot(body, Pose{exp_so3({M_PI / 2, 0, 0}), {0.5, 0, 0}}, 0.0, out);
  EXPECT_LT((out.X_WP.p - Vector3d(0, 0.5, 0)).norm(), kPivotRounding);
  EXPECT_LT((out.v_WP - Vector3d(-1, 0, 0)).norm(), kPivotRounding);
  EXPECT_LT((out.a_WP - Vector3d(0, -2, 0)).norm(), kPivotRounding);
  EXPECT_LT((out.w_WP_P - Vector3d(0, 2, 0)).norm(), kPivotRounding);  // P's y is B's z
}

// Central differences of the pose along a turn of constant rate must give the twist.
TEST(Pivot, VelocityAndAccelerationAreTheDerivativesOfThePosition) {
  const auto at = [](double t) {
    auto body = turning_body();
    body.X_WB.q = body.X_WB.q * exp_so3(body.w_WB_B * t);
    body.X_WB.p += body.v_WB * t + 0.5 * body.a_WB * t * t;
    body.v_WB += body.a_WB * t;
    BodyPose out;
    write_pivot(body, kPivot, 0.0, out);
    return out;
  };
  constexpr double kStep_s = 1e-4;
  constexpr double kDifference = 1e-6;  // third derivative · step² of a few m/s³
  const auto before = at(-kStep_s);
  const auto now = at(0);
  const auto after = at(kStep_s);
  EXPECT_LT((now.v_WP - (after.X_WP.p - before.X_WP.p) / (2 * kStep_s)).norm(), kDifference);
  EXPECT_LT((now.a_WP - (after.v_WP - before.v_WP) / (2 * kStep_s)).norm(), kDifference);
  const Vector3d turn = log_so3(before.X_WP.q.conjugate() * after.X_WP.q) / (2 * kStep_s);
  EXPECT_LT((now.w_WP_P - turn).norm(), kDifference);
}

TEST(Pivot, CovarianceIsPropagatedByTheJacobian) {
  auto body = turning_body();
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const Matrix15d A = Matrix15d::NullaryExpr([&] { return normal(random); });
  body.covariance = A * A.transpose();
  BodyPose out;
  write_pivot(body, kPivot, 0.0, out);
  const Eigen::MatrixXd J = central_differences(
      [&](const VectorXd& d) {
        auto e = body;
        e.X_WB.p += d.segment<3>(estimate_block::kPosition);
        e.X_WB.q = exp_so3(d.segment<3>(estimate_block::kAttitude)) * e.X_WB.q;
        e.v_WB += d.segment<3>(estimate_block::kVelocity);
        e.w_WB_B -= d.segment<3>(estimate_block::kBiasW);
        BodyPose moved;
        write_pivot(e, kPivot, 0.0, moved);
        VectorXd error(12);
        error << moved.X_WP.p - out.X_WP.p, log_so3(moved.X_WP.q * out.X_WP.q.conjugate()),
            moved.v_WP - out.v_WP, moved.w_WP_P - out.w_WP_P;
        return error;
      },
      15);
  const Eigen::MatrixXd expected = propagated(J, body.covariance);
  EXPECT_LT((out.covariance - expected).norm(), 1e-7 * expected.norm());
}

TEST(Pivot, GyroNoiseReachesRateAndLeverArmVelocity) {
  BodyEstimate body;
  BodyPose out;
  write_pivot(body, Pose{Eigen::Quaterniond::Identity(), {0.5, 0, 0}}, 0.04, out);
  VectorXd expected = VectorXd::Zero(12);
  expected.segment<3>(6) << 0, 0.01, 0.01;
  expected.segment<3>(9).setConstant(0.04);
  EXPECT_LT((out.covariance.diagonal() - expected).norm(), kPivotRounding);
}

TEST(BodyPose, SigmaIsTheWorstAxis) {
  BodyPose pose;
  pose.covariance.diagonal().head<6>() << 0.01, 0.04, 0.02, 0.09, 0.01, 0.01;
  EXPECT_DOUBLE_EQ(pose.position_sigma_m(), 0.2);
  EXPECT_DOUBLE_EQ(pose.rotation_sigma_rad(), 0.3);
}

}  // namespace
}  // namespace fiducap
