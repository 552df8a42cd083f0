#include "mapping/refinement.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>

#include <Eigen/Geometry>

#include "base/so3.hpp"
#include "support/bundle_nees.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr double kNoise_px = 0.3;
constexpr double kEdge_m = 0.2;
constexpr int kTags = 12;
constexpr int kFrames = 60;
// Standard deviations of chi-square: what an estimate at the Cramér–Rao bound exceeds once in 10^5.
constexpr double kSigmas = 4.5;
// The start is 50 mm off per axis.
constexpr double kStartError_m = 0.05;
// Nothing but rounding.
constexpr double kSame = 1e-9;

/// Turns and shifts a pose by six numbers in the coordinates of KnownTag::covariance.
Pose moved(const Pose& X, const Eigen::VectorXd& by) {
  return {(exp_so3(by.tail<3>()) * X.q).normalized(), X.p + by.head<3>()};
}

Pose looking(const Eigen::Vector3d& from, const Eigen::Vector3d& at) {
  const Eigen::Vector3d z = (at - from).normalized();
  const Eigen::Vector3d x = Eigen::Vector3d(0, 0, -1).cross(z).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return {Eigen::Quaterniond(R), from};
}

/// Twelve tags on the four walls of a room of 4 m × 4 m, and a body with two cameras walking round
/// its middle.
class RefinementTest : public ::testing::Test {
 protected:
  RefinementTest() {
    CameraMount camera;
    camera.model = {800, 600, 450, 455, 402, 297, Distortion::kNone, {}};
    camera.X_BV = {exp_so3({0.02, -0.03, 0.01}), {0.1, 0.02, -0.01}};
    problem_.cameras.push_back(camera);
    camera.X_BV = {exp_so3({0.0, 1.5, 0.0}), {-0.1, 0.0, 0.03}};
    problem_.cameras.push_back(camera);
    problem_.corner_noise_px = kNoise_px;
    for (int id = 0; id < kTags; ++id) {
      const double angle = (id / 3) * M_PI / 2;
      const Eigen::Vector3d along(-std::sin(angle), std::cos(angle), 0);
      const Eigen::Vector3d wall(2 * std::cos(angle), 2 * std::sin(angle), 0);
      const Eigen::Vector3d p =
          wall + (id % 3 - 1) * 0.9 * along + Eigen::Vector3d(0, 0, 0.2 * (id % 2));
      // z out of the face into the room, y up.
      Eigen::Matrix3d R;
      R << -along, Eigen::Vector3d::UnitZ(), -wall.normalized();
      true_tags_.push_back(
          {id, kEdge_m, {Eigen::Quaterniond(R).normalized(), p}, Matrix6d::Zero()});
    }
    for (int i = 0; i < kFrames; ++i) see(2 * M_PI * i / kFrames);
  }

  void see(double angle) {
    const Eigen::Vector3d from(-0.5 * std::cos(angle), -0.6 * std::sin(angle),
                               0.3 * std::sin(3 * angle));
    const Pose X_WB = looking(from, {2 * std::cos(angle), 2 * std::sin(angle), 0.2});
    RefinementFrame frame{X_WB, {}};
    for (int k = 0; k < 2; ++k) {
      const CameraMount& camera = problem_.cameras[static_cast<std::size_t>(k)];
      TagObservations image;
      image.camera = k;
      for (const KnownTag& tag : true_tags_) {
        if (const auto seen = project(tag, camera, X_WB)) image.tags.push_back(*seen);
      }
      frame.images.push_back(image);
    }
    true_poses_.push_back(X_WB);
    problem_.frames.push_back(frame);
  }

  std::optional<TagObservation> project(const KnownTag& tag, const CameraMount& camera,
                                        const Pose& X_WB) {
    const Pose X_VT = (X_WB * camera.X_BV).inverse() * tag.X_WT;
    if ((X_VT.q * Eigen::Vector3d::UnitZ()).z() > -0.2) return std::nullopt;
    TagObservation seen;
    seen.tag_id = tag.tag_id;
    seen.edge_m = tag.edge_m;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector3d p = X_VT * tag_corner(i, tag.edge_m);
      if (p.z() < 0.2) return std::nullopt;
      const auto k = static_cast<std::size_t>(i);
      // A lens that shears and stretches, so that forgetting it shows.
      seen.ideal_from_raw[k] << 1.1, 0.05, -0.02, 0.95;
      const Eigen::Vector2d noise(noise_(random_), noise_(random_));
      seen.corners_px[k] = camera.model.pinhole(p) + seen.ideal_from_raw[k] * noise;
      const Eigen::Vector2d px = camera.model.pinhole(p);
      if (px.x() < 0 || px.y() < 0 || px.x() > camera.model.width || px.y() > camera.model.height)
        return std::nullopt;
    }
    return seen;
  }

  Eigen::VectorXd jolt(double position_m, double rotation_rad) {
    std::normal_distribution<double> unit;
    Eigen::VectorXd by(6);
    for (int i = 0; i < 6; ++i) by(i) = (i < 3 ? position_m : rotation_rad) * unit(random_);
    return by;
  }

  /// Every start pose 5 cm and 3° wrong; tag 0 is where it is.
  void perturb() {
    problem_.estimated = true_tags_;
    for (KnownTag& tag : problem_.estimated)
      if (tag.tag_id != 0) tag.X_WT = moved(tag.X_WT, jolt(kStartError_m, 0.05));
    for (RefinementFrame& frame : problem_.frames)
      frame.X_WB = moved(frame.X_WB, jolt(kStartError_m, 0.05));
  }

  /// The first estimated tag with its true pose becomes an input.
  void fix(int tag_id) {
    std::erase_if(problem_.estimated, [&](const KnownTag& tag) { return tag.tag_id == tag_id; });
    problem_.fixed.push_back(true_tags_[static_cast<std::size_t>(tag_id)]);
  }

  /// The answer is as close to the truth as the corners of `evidence` allow; `gauge_freedom` as for
  /// bundle_nees.
  void expect_efficient(const RefinementResult& result, const RefinementProblem& evidence,
                        int gauge_freedom = 0) const {
    const BundleNees nees =
        bundle_nees(evidence, true_tags_, true_poses_, result.tags, result.X_WB, gauge_freedom);
    EXPECT_LT(std::abs(nees.sigmas()), kSigmas) << nees.value << " of " << nees.numbers;
  }

  std::mt19937 random_{7};
  std::normal_distribution<double> noise_{0.0, kNoise_px};
  std::vector<KnownTag> true_tags_;
  std::vector<Pose> true_poses_;
  RefinementProblem problem_;
};

TEST_F(RefinementTest, DerivativesOfASightingAreThoseOfCentralDifferences) {
  const RefinementFrame& frame = problem_.frames[5];
  const Pose X_WB = moved(frame.X_WB, jolt(0.02, 0.02));
  int checked = 0;
  for (const TagObservations& image : frame.images) {
    const CameraMount& camera = problem_.cameras[static_cast<std::size_t>(image.camera)];
    for (const TagObservation& seen : image.tags) {
      const Pose X_WT =
          moved(true_tags_[static_cast<std::size_t>(seen.tag_id)].X_WT, jolt(0.02, 0.02));
      const SightingResidual at = sighting_residual(seen, camera, X_WB, X_WT);
      ASSERT_TRUE(at.in_front);
      expect_jacobian(at.d_body, [&](const Eigen::VectorXd& d) {
        return sighting_residual(seen, camera, moved(X_WB, d), X_WT).y;
      });
      expect_jacobian(at.d_tag, [&](const Eigen::VectorXd& d) {
        return sighting_residual(seen, camera, X_WB, moved(X_WT, d)).y;
      });
      ++checked;
    }
  }
  EXPECT_GE(checked, 2);
}

TEST_F(RefinementTest, DerivativesOfAPriorAreThoseOfCentralDifferences) {
  for (const double size : {0.0, 1e-8, 0.7}) {
    const Pose X_WT = moved(true_tags_[4].X_WT, jolt(size, size));
    expect_jacobian(prior_residual(X_WT, true_tags_[4].X_WT).d_tag, [&](const Eigen::VectorXd& d) {
      return prior_residual(moved(X_WT, d), true_tags_[4].X_WT).y;
    });
  }
}

TEST_F(RefinementTest, FindsTagsAndPosesFromAWrongStart) {
  perturb();
  problem_.gauge_tag = 0;
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  expect_efficient(*result, problem_);
  EXPECT_LT(result->final_cost, result->initial_cost);
}

TEST_F(RefinementTest, ExplainsTheCornersAsWellAsTheirNoiseAllows) {
  perturb();
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  double squares = 0;
  int numbers = -6 * (kFrames + kTags - 1);
  for (std::size_t i = 0; i < problem_.frames.size(); ++i) {
    for (const TagObservations& image : problem_.frames[i].images) {
      for (const TagObservation& seen : image.tags) {
        const auto& tag = result->tags[static_cast<std::size_t>(seen.tag_id)];
        squares += sighting_residual(seen, problem_.cameras[static_cast<std::size_t>(image.camera)],
                                     result->X_WB[i], tag.X_WT)
                       .y.squaredNorm();
        numbers += 8;
      }
    }
  }
  ASSERT_GT(numbers, 500);
  // The square sum of n normal numbers scatters by sqrt(2 / n): 5 sigma with 500 of them.
  EXPECT_NEAR(squares / numbers / (kNoise_px * kNoise_px), 1.0, 0.3);
}

TEST_F(RefinementTest, OneTagReadAsAnotherHardlyPulls) {
  perturb();
  problem_.gauge_tag = 0;
  std::vector<TagObservation>& tags = problem_.frames[10].images[0].tags;
  ASSERT_GE(tags.size(), 2u);
  tags[0].tag_id = (tags[0].tag_id + 6) % kTags;  // one from the opposite wall
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  tags.erase(tags.begin());
  expect_efficient(*result, problem_);
}

TEST_F(RefinementTest, FixedTagsDoNotMoveAndHoldTheRest) {
  perturb();
  fix(3);
  fix(7);
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_EQ(result->tags.size(), problem_.estimated.size());
  expect_efficient(*result, problem_);
}

TEST_F(RefinementTest, InAMapThatIsFixedOnlyThePosesMove) {
  perturb();
  problem_.estimated.clear();
  problem_.fixed = true_tags_;
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_TRUE(result->tags.empty());
  expect_efficient(*result, problem_);
}

TEST_F(RefinementTest, TheGaugeTagStaysAndElseTheFirstSeen) {
  perturb();
  problem_.gauge_tag = 5;
  const Pose start_5 = problem_.estimated[5].X_WT;
  const auto by_5 = refine(problem_);
  ASSERT_TRUE(by_5) << by_5.error().text();
  EXPECT_LT((by_5->tags[5].X_WT.p - start_5.p).norm(), kSame);
  EXPECT_LT(angle_between(by_5->tags[5].X_WT.q, start_5.q), kSame);
  problem_.gauge_tag = 99;  // nobody saw it
  const auto by_first = refine(problem_);
  ASSERT_TRUE(by_first) << by_first.error().text();
  EXPECT_LT((by_first->tags[0].X_WT.p - problem_.estimated[0].X_WT.p).norm(), kSame);
  EXPECT_GT((by_first->tags[5].X_WT.p - start_5.p).norm(), kStartError_m / 5)
      << "the gauge tag was wrong by centimetres";
}

TEST_F(RefinementTest, APriorPullsWhereNothingElseDoes) {
  perturb();
  // All tags are given 1 m away in x: loosely, yet nothing else says where the room is.
  for (const KnownTag& tag : true_tags_) {
    KnownTag prior = tag;
    prior.X_WT.p.x() += 1.0;
    prior.covariance.diagonal() << 0.25, 0.25, 0.25, 0.01, 0.01, 0.01;
    problem_.priors.push_back(prior);
  }
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  RefinementResult back = *result;
  Eigen::Vector3d mean_error = Eigen::Vector3d::Zero();
  for (KnownTag& tag : back.tags) {
    tag.X_WT.p.x() -= 1.0;
    mean_error += (tag.X_WT.p - true_tags_[static_cast<std::size_t>(tag.tag_id)].X_WT.p) / kTags;
  }
  for (Pose& X_WB : back.X_WB) X_WB.p.x() -= 1.0;
  expect_efficient(back, problem_, 6);
  // The priors balance: they agree with each other, so the noise of the corners leaves their mean
  // alone.
  EXPECT_LT(mean_error.norm(), 1e-6);
}

TEST_F(RefinementTest, OfTwoPriorsTheTighterWins) {
  perturb();
  for (const int id : {2, 8}) {
    KnownTag prior = true_tags_[static_cast<std::size_t>(id)];
    const double sigma_m = id == 2 ? 0.01 : 0.1;
    if (id == 8) prior.X_WT.p.z() += 0.05;
    prior.covariance.diagonal() << Eigen::Vector3d::Constant(sigma_m * sigma_m),
        Eigen::Vector3d::Constant(1e-6);
    problem_.priors.push_back(prior);
  }
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  // 1 : 100 by variance: half a millimetre of the 50 mm. The solver stops when a step changes the
  // cost (about 900) by less than 1e-8 of it, which a shift by 0.04 mm does; three such steps are
  // forgiven.
  EXPECT_NEAR(result->tags[2].X_WT.p.z() - true_tags_[2].X_WT.p.z(), 0.05 / 101, 1.2e-4);
}

TEST_F(RefinementTest, ATagThatNobodySawStaysOrGoesToItsPrior) {
  perturb();
  fix(0);
  const Eigen::Quaterniond upright = Eigen::Quaterniond::Identity();
  problem_.estimated.push_back({50, kEdge_m, {upright, {9, 9, 9}}, Matrix6d::Zero()});
  problem_.estimated.push_back({51, kEdge_m, {upright, {9, 9, 9}}, Matrix6d::Zero()});
  problem_.priors.push_back({51, kEdge_m, {upright, {7, 7, 7}}, Matrix6d::Identity()});
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  ASSERT_EQ(result->tags.size(), 13u);
  EXPECT_LT((result->tags[11].X_WT.p - Eigen::Vector3d(9, 9, 9)).norm(), kSame);
  EXPECT_LT((result->tags[12].X_WT.p - Eigen::Vector3d(7, 7, 7)).norm(), kSame);
}

TEST_F(RefinementTest, AStartBehindTheTagsEndsWithFiniteNumbers) {
  perturb();
  problem_.frames[3].X_WB.q = problem_.frames[3].X_WB.q * exp_so3({0, M_PI, 0});
  const auto result = refine(problem_);
  ASSERT_TRUE(result) << result.error().text();
  for (const Pose& X_WB : result->X_WB) EXPECT_TRUE(X_WB.p.allFinite());
}

TEST_F(RefinementTest, SaysWhatIsWrongWithTheInput) {
  perturb();
  const auto complains = [](const RefinementProblem& problem, const char* about) {
    const auto result = refine(problem);
    ASSERT_FALSE(result);
    EXPECT_THAT(result.error().text(), HasSubstr(about));
  };
  RefinementProblem bad = problem_;
  bad.frames.clear();
  complains(bad, "none");
  bad = problem_;
  bad.estimated.clear();
  complains(bad, "none");
  bad = problem_;
  bad.corner_noise_px = 0;
  complains(bad, "corner_noise_px");
  bad = problem_;
  bad.frames[2].images[0].camera = 2;
  complains(bad, "camera 2 of 2");
  bad = problem_;
  bad.fixed.push_back(bad.estimated[1]);
  complains(bad, "tag 1: an id may come once");
  bad = problem_;
  bad.frames[2].X_WB.p.x() = NAN;
  complains(bad, "frame 2");
  bad = problem_;
  bad.frames[2].images[0].tags[0].ideal_from_raw[1].setZero();
  complains(bad, "frame 2");
  bad = problem_;
  bad.priors.push_back(true_tags_[4]);
  complains(bad, "tag 4: the prior needs a positive definite covariance");
}

}  // namespace
}  // namespace fiducap
