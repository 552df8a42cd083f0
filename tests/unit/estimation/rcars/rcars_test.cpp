// The filter of RCARS: every analytic Jacobian against central differences, every change of the
// covariance against the Jacobian of the change of the mean, the gate, and a short run with truth.
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "base/pose.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/rcars/equations.hpp"
#include "estimation/rcars/state.hpp"
#include "example_room.hpp"
#include "example_tags.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap::rcars {
namespace {

const Eigen::Vector3d kGravity(0, 0, -9.81);
constexpr double kNoise_px = 0.4;
// First order covariances against central differences of the means, relative to the largest number.
constexpr double kFirstOrder = 1e-6;

/// A body with two cameras and three tags in front of camera 0, nothing aligned with anything.
State example_state() {
  State x;
  x.r = {1.2, -0.7, 0.9};
  x.v = {0.5, 0.3, -0.4};
  x.q = exp_so3({0.4, -0.6, 1.1});
  x.b_f = {0.05, -0.04, 0.06};
  x.b_w = {0.006, -0.004, 0.005};
  x.cameras = {{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}},
               {exp_so3({0.15, -1.45, 0.1}), {0.06, 0.11, 0.02}}};
  for (int i = 0; i < 3; ++i) {
    const Pose X_VT{exp_so3({3.0 + 0.1 * i, 0.2 - 0.3 * i, 0.4}),
                    {-0.3 + 0.3 * i, 0.1 * i, 1.5 + 0.4 * i}};
    x.tags.push_back({.tag_id = 10 + i, .edge_m = 0.2, .X_VT = X_VT});
  }
  std::mt19937 random(7);
  std::normal_distribution<double> gauss;
  Eigen::MatrixXd A(x.size(), x.size());
  for (Eigen::Index i = 0; i < A.size(); ++i) A(i) = gauss(random);
  x.P = 0.01 * A * A.transpose();
  return x;
}

InertialInput example_input() {
  InertialInput input;
  input.w_B = {0.8, -1.2, 0.5};
  input.f_B = {1.0, -2.0, 9.0};
  return input;
}

State with_error(State x, const Eigen::VectorXd& error) {
  x.add_error(error);
  return x;
}

Vector6d left_error(const Pose& from, const Pose& to) {
  Vector6d out;
  out << to.p - from.p, log_so3(to.q * from.q.conjugate());
  return out;
}

/// δ of other = x ⊞ δ
Eigen::VectorXd error_between(const State& x, const State& other) {
  Eigen::VectorXd out(x.size());
  out.segment<3>(kR) = other.r - x.r;
  out.segment<3>(kQ) = log_so3(x.q.conjugate() * other.q);
  out.segment<3>(kV) = other.v - x.v;
  out.segment<3>(kBf) = other.b_f - x.b_f;
  out.segment<3>(kBw) = other.b_w - x.b_w;
  for (std::size_t c = 0; c < x.cameras.size(); ++c)
    out.segment<6>(x.camera_at(static_cast<int>(c))) = left_error(x.cameras[c], other.cameras[c]);
  for (std::size_t i = 0; i < x.tags.size(); ++i)
    out.segment<6>(x.tag_at(i)) = left_error(x.tags[i].X_VT, other.tags[i].X_VT);
  return out;
}

/// Checks that `change` transforms P with the Jacobian of its own mean and adds this noise.
void expect_covariance_follows_mean(const std::function<void(State&)>& change,
                                    const Eigen::MatrixXd& noise = {}) {
  const State before = example_state();
  State after = before;
  change(after);
  const Eigen::MatrixXd J = central_differences(
      [&](const Eigen::VectorXd& d) {
        State other = with_error(before, d);
        change(other);
        return error_between(after, other);
      },
      before.size());
  Eigen::MatrixXd expected = propagated(J, before.P);
  if (noise.size() > 0) expected += noise;
  expect_matrices_near(after.P, expected, kFirstOrder);
  expect_matrices_near(after.P, after.P.transpose(), 1e-12);
}

TEST(RcarsPrediction, TheBodysJacobianMatchesDifferences) {
  for (const double dt : {1e-6, 0.005, 0.05}) {
    State after = example_state();
    const BodyStep step = step_body(after, example_input(), kGravity, dt);
    const auto f = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      Eigen::VectorXd error = Eigen::VectorXd::Zero(after.size());
      error.head<kBodySize>() = d;
      State x = with_error(example_state(), error);
      static_cast<void>(step_body(x, example_input(), kGravity, dt));
      return error_between(after, x).head<kBodySize>();
    };
    expect_jacobian(step.F, f);
  }
}

void predict(State& x, int steps, const InertialInput& input) {
  Prediction prediction(x);
  for (int i = 0; i < steps; ++i) prediction.step(x, input, kGravity, 0.005);
  prediction.finish(x);
}

TEST(RcarsPrediction, TheCovarianceFollowsTheMean) {
  expect_covariance_follows_mean([](State& x) { predict(x, 10, example_input()); });
}

TEST(RcarsPrediction, NoiseOfTheImuMovesTagsAsItMovesTheBody) {
  InertialInput noisy = example_input();
  noisy.gyro_noise = 1e-3;
  noisy.accel_noise = 1e-2;
  State exact = example_state();
  State x = exact;
  predict(exact, 10, example_input());
  predict(x, 10, noisy);
  const Eigen::MatrixXd Q = x.P - exact.P;
  EXPECT_GT(least_eigenvalue(Q.topLeftCorner(9, 9)), 0);
  EXPECT_GT(Q(x.tag_at(1), x.tag_at(1)), 1e-10);
  // A tag stands still in W.
  x.P = Q;
  for (std::size_t i = 0; i < x.tags.size(); ++i)
    EXPECT_LT(x.covariance_of(x.X_WT(i)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(RcarsPrediction, KeepsTagsInTheWorkspace) {
  const State before = example_state();
  State after = before;
  predict(after, 50, example_input());
  for (std::size_t i = 0; i < before.tags.size(); ++i)
    EXPECT_LT(left_error(before.X_WT(i).X, after.X_WT(i).X).norm(), 1e-9);
}

/// A tag in view of one of two cameras, in the state or known.
class RcarsInnovation : public testing::TestWithParam<std::tuple<int, bool>> {
 protected:
  RcarsInnovation() {
    const Pose X_VT =
        x_.cameras[static_cast<std::size_t>(view_.camera)].inverse() * (x_.X_BW().X * known_.X_WT);
    seen_ = example_observation(11, 0.2, X_VT, model_);
  }
  [[nodiscard]] Sighting sighting(const KnownTag& known) const {
    return {&seen_, std::get<1>(GetParam()) ? &known : nullptr};
  }
  const State x_ = example_state();
  const CameraModel model_ = example_camera();
  const View view_{std::get<0>(GetParam()), model_, kNoise_px};
  KnownTag known_{11, 0.2, x_.X_WT(1).X, Matrix6d::Zero()};
  TagObservation seen_;
};

TEST_P(RcarsInnovation, MatchesDifferences) {
  const Innovation y = innovation(x_, view_, sighting(known_));
  ASSERT_TRUE(y.in_front);
  EXPECT_LT(y.y.norm(), 1e-9);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(8, x_.size());
  for (const auto& [at, block] : y.H) H.middleCols<6>(at) += block;
  expect_jacobian(-H, [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    return innovation(with_error(x_, d), view_, sighting(known_)).y;
  });
}

TEST_P(RcarsInnovation, IncludesTheCovarianceOfAKnownPose) {
  KnownTag uncertain = known_;
  uncertain.covariance.diagonal() << 1e-4, 4e-4, 9e-4, 1e-3, 2e-3, 3e-3;
  Eigen::MatrixXd R = kNoise_px * kNoise_px * Matrix8d::Identity();
  if (sighting(known_).known != nullptr)
    R += propagated(central_differences(
                        [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
                          KnownTag other = known_;
                          other.X_WT.p += d.head<3>();
                          other.X_WT.q = exp_so3(d.tail<3>()) * other.X_WT.q;
                          return innovation(x_, view_, sighting(other)).y;
                        },
                        6),
                    uncertain.covariance);
  expect_matrices_near(innovation(x_, view_, sighting(uncertain)).R, R, 1e-5);
}

INSTANTIATE_TEST_SUITE_P(CamerasAndKinds, RcarsInnovation,
                         testing::Combine(testing::Values(0, 1), testing::Bool()));

TEST(RcarsAugmentation, ATagHasTheErrorsOfItsCornersAndOfBothExtrinsics) {
  const CameraModel model = example_camera();
  const State before = example_state();
  const Pose X_VT{exp_so3({3.0, 0.2, 0.1}), {0.1, 0.05, 1.2}};
  const TagObservation seen = example_observation(42, 0.2, X_VT, model);
  for (const int camera : {0, 1}) {
    Matrix6d turn = Matrix6d::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() =
        (before.cameras[0].inverse() * before.cameras[static_cast<std::size_t>(camera)]).rotation();
    const Matrix86d H = corner_residual(seen, X_VT, model).H / kNoise_px;
    Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(before.size() + 6, before.size() + 6);
    noise.bottomRightCorner<6, 6>() =
        propagated(turn, fiducap::inverse(propagated(H.transpose(), Matrix8d::Identity())));
    expect_covariance_follows_mean(
        [&](State& x) {
          augment(x, {camera, model, kNoise_px}, seen, X_VT);
        },
        noise);
  }
}

TEST(RcarsWorkspace, IsThatOfTheReferenceTag) {
  HeadingRule rule;
  rule.axis = 1;
  rule.yaw_rad = 0.3;
  rule.X_WT = {exp_so3({0.2, 0.1, -0.4}), {3, -2, 1}};
  expect_covariance_follows_mean([&](State& x) { define_by_reference(x, 1, rule); });

  State x = example_state();
  const Pose before = x.X_BW().X.inverse();
  const Pose shift = define_by_reference(x, 2, rule);
  EXPECT_LT(left_error(shift * before, x.X_BW().X.inverse()).norm(), 1e-9);
  EXPECT_NEAR((shift.q * Eigen::Vector3d::UnitZ()).z(), 1, 1e-12) << "up must stay up";
  EXPECT_LT((x.X_WT(2).X.p - rule.X_WT.p).norm(), 1e-9);
  EXPECT_LT(log_so3(turn_to_heading(rule, x.X_WT(2).X.q)).norm(), 1e-9);
  const Matrix6d P = x.covariance_of(x.X_WT(2));
  EXPECT_LT(P.topLeftCorner(3, 3).cwiseAbs().maxCoeff(), 1e-9) << "by definition";
  State again = x;
  define_by_reference(again, 2, rule);
  EXPECT_LT(error_between(x, again).norm(), 1e-9);
  EXPECT_LT((x.P - again.P).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(RcarsWorkspace, OfAKnownTagIsUncertainUntilItsUpdate) {
  State x = example_state();
  x.P *= 0.01;  // small enough for one linear update
  const Pose X_WT = Pose{exp_so3({0, 0, 0.7}), {3, -2, 1}} * x.X_WT(1).X;  // gravity agrees
  const KnownTag known{11, 0.2, X_WT, 1e-6 * Matrix6d::Identity()};
  define_by_known(x, 0, x.tags[1].X_VT, X_WT);
  EXPECT_LT((x.X_WT(1).X.p - X_WT.p).norm(), 1e-9);
  EXPECT_GT(x.covariance_of(x.X_WT(1)).topLeftCorner(3, 3).trace(), 100);
  fuse_prior(x, 1, known);
  EXPECT_LT(x.covariance_of(x.X_WT(1)).trace(), 6.1e-6);
}

TEST(RcarsUpdate, RejectsAWrongTagAndUsesTheOthersJointly) {
  const CameraModel model = example_camera();
  State x = example_state();
  x.P *= 1e-3;
  std::mt19937_64 random(3);
  std::vector<TagObservation> seen;
  for (const Tag& tag : x.tags)
    seen.push_back(noisy_observation(tag.tag_id, 0.2, tag.X_VT, model, kNoise_px, random));
  for (Eigen::Vector2d& corner : seen[1].corners_px) corner.x() += 400;
  const std::vector<Sighting> tags{{&seen[0], {}}, {&seen[1], {}}, {&seen[2], {}}};
  const State before = x;
  UpdateReport report;
  const auto used = update(x, {0, model, kNoise_px}, tags, chi_square_quantile(8, 0.999), report);
  EXPECT_EQ(used, (std::vector<bool>{true, false, true}));
  EXPECT_EQ(report.tags_rejected, 1);
  EXPECT_EQ(report.nis_dof, 16);
  EXPECT_LT(report.reprojection_px, 2 * kNoise_px);
  EXPECT_LT(x.P.trace(), before.P.trace());
  EXPECT_GT(least_eigenvalue(x.P), 0);
  EXPECT_LT(x.covariance_of(x.X_VT(0)).trace(), 0.5 * before.covariance_of(x.X_VT(0)).trace());
}

// Six tags of 60 px at 2 m with 0.3 px: a pose is good to some millimetres.
constexpr double kGood_m = 0.02;

ExampleRoom room(std::uint64_t seed = 1) {
  ExampleRoom::Setup setup{.filter = "robocentric", .seed = seed};
  setup.estimator.corner_noise_px = setup.pixel_sigma;
  setup.estimator.estimate_extrinsics = false;  // the configured ones are the truth
  return ExampleRoom(setup);
}

TEST(RcarsFilter, TracksABodyWithHonestCovariances) {
  constexpr int kSeeds = 20;
  // 95 % band of the mean of that many chi-square variables of 6 degrees, per degree of freedom.
  const double band = 1.96 * std::sqrt(2.0 / 6 / kSeeds);
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    ExampleRoom one = room(seed);
    const std::vector<KnownTag> map = one.known_all(0);
    const UpdateReport report = one.images(200, {.tags = map});
    EXPECT_EQ(report.tags_used, 6);
    EXPECT_TRUE(one.beliefs().empty()) << "all tags are known";
    EXPECT_LT(one.error_m(), kGood_m);
    nees += one.pose_nees() / kSeeds;
  }
  EXPECT_NEAR(nees, 1, band);
}

TEST(RcarsFilter, MapsTheRoomInTheAxesOfTheReferenceTag) {
  ExampleRoom one = room();
  one.images(100);
  ASSERT_TRUE(one.is_anchored());
  const Pose X_WR = one.X_WR();
  one.images(60);
  EXPECT_LT(one.error_m(X_WR), kGood_m);
  EXPECT_EQ(one.beliefs().size(), 6u);
  for (const auto& [id, X_RT] : one.tags) one.expect_belief(id, kGood_m, X_WR);
}

TEST(RcarsFilter, TakesTheWorkspaceOfTheMapWhenItMayNotDefineOne) {
  ExampleRoom one = room();
  one.images(60, {.may_define_workspace = false});
  ASSERT_TRUE(one.filter->running());
  ASSERT_FALSE(one.is_anchored());
  const std::vector<KnownTag> map = one.known_all(1e-4);
  one.images(40, {.tags = map, .may_define_workspace = false});
  ASSERT_TRUE(one.is_anchored());
  EXPECT_LT(one.error_m(), kGood_m);
}

TEST(RcarsFilter, FusesSurveyedTags) {
  ExampleRoom one = room();
  one.filter->set_tag_priors(one.known_all(1e-3));
  one.images(100);
  EXPECT_LT(one.error_m(), kGood_m);
  EXPECT_EQ(one.beliefs().size(), 6u);
}

TEST(RcarsFilter, NeedsAnImu) {
  EXPECT_TRUE(fault_of_filter("robocentric", {}));
  EXPECT_FALSE(fault_of_filter("robocentric", {.cameras = {}, .imu = ImuNoise{}}));
  EXPECT_FALSE(fault_of_filter("world", {}));
}

TEST(RcarsFilter, RestartsWhenNothingFitsForLong) {
  ExampleRoom one = room();
  const int generation = one.images(100).generation;
  for (auto& [id, X_RT] : one.tags) X_RT.q = X_RT.q * exp_so3({0, 0, ExampleRoom::kQuarterTurn});
  EXPECT_EQ(one.images(190).generation, generation) << "less than ten seconds";
  const UpdateReport report = one.images(60);
  EXPECT_EQ(report.generation, generation + 1);
  EXPECT_EQ(report.tags_used, 6);
}

}  // namespace
}  // namespace fiducap::rcars
