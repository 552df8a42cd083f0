// One map of two bodies: from the bounds of both, and from one big information matrix.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "base/pose.hpp"
#include "mapping/tag_map.hpp"
#include "simulation/estimation_data.hpp"
#include "support/bound/causal_bound.hpp"
#include "support/bound/joint_map_bound.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap::bound {
namespace {

using Eigen::MatrixXd;

constexpr int kLooks = 8;
constexpr double kStep_s = 0.05;
constexpr int kReference = 4;
const std::vector<int> kOfFirst{4, 9};
const std::vector<int> kOfSecond{9, 14};

/// Two bodies with different motions.
struct Scene {
  [[nodiscard]] TruthSample truth(int body, int k) const {
    const double t = k * kStep_s;
    const double way = body == 0 ? 1 : -1;
    TruthSample s;
    s.at = instant_from_ns(0) + from_seconds(t);
    s.X_WB = {exp_so3({0.2 * t, way * 0.5 * t, -way * 0.6 * t}),
              {0.4 * t * t, -way * 0.3 * t, 0.2 * t * t}};
    s.v_WB = {0.8 * t, -way * 0.3, 0.4 * t};
    return s;
  }
  [[nodiscard]] BoundProblem problem() const {
    BoundProblem p;
    p.camera = forward_mount();
    p.imu = ImuNoise{1e-3, 1e-4, 1e-2, 1e-3, 200};
    Eigen::Matrix3d facing;  // tag z against x, tag y up
    facing << 0, 0, -1, -1, 0, 0, 0, 1, 0;
    const Eigen::Quaterniond q(facing);
    p.tags = {{4, 0.2, {q * exp_so3({0.4, 0.2, 0}), {1.5, 0.2, 0.1}}, 0, 0},
              {9, 0.2, {q * exp_so3({-0.3, 0.5, 0.4}), {1.7, -0.3, 0.2}}, 0, 0},
              {14, 0.2, {q * exp_so3({0.3, -0.4, 0.2}), {1.9, 0.1, -0.3}}, 0, 0}};
    p.reference_tag = kReference;
    return p;
  }
  [[nodiscard]] TagsCovariance knowledge(int body, const std::vector<int>& seen) const {
    CausalBound bound(problem());
    for (int k = 0; k < kLooks; ++k) {
      bound.move_to(truth(body, k));
      bound.see(seen);
    }
    return bound.tags();
  }
  [[nodiscard]] std::vector<TagsCovariance> both() const {
    return {knowledge(0, kOfFirst), knowledge(1, kOfSecond)};
  }
  [[nodiscard]] JointMap map(std::span<const TagsCovariance> bodies) const {
    return joint_map_bound(problem().tags, kReference, bodies);
  }
};

/// Tag `i` against place and heading of the first one, of their joint covariance (6 each: place,
/// rotation).
Eigen::Matrix<double, 6, 6> against_first(const MatrixXd& P, const std::vector<RecordedTag>& tags,
                                          std::size_t i) {
  const Pose& X_WR = tags.front().X_WT;
  const RelativeRows J = relative_to_level(tags[i].X_WT, X_WR, heading_axis(X_WR.q));
  const int at = static_cast<int>(6 * i);
  const std::vector<int> index{at + 3, at + 4, at + 5, at, at + 1, at + 2, 0, 1, 2, 3, 4, 5};
  const Matrix12 joint = marginal(P, index);
  return J * joint * J.transpose();
}

void expect_near(const MatrixXd& found, const MatrixXd& expected, double share) {
  ASSERT_EQ(found.rows(), expected.rows());
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), share * expected.cwiseAbs().maxCoeff())
      << found << "\n\n"
      << expected;
}

// Covariances hold numbers from 1e-8 (m², of neighbours) to 1; half of the digits remain.
constexpr double kRounding = 1e-6;

class JointMapBoundTest : public testing::Test {
 protected:
  const Scene scene_{};
};

/// All states of two bodies, their cameras and the tags at once: information in, tags out.
MatrixXd tags_at_once(const Scene& scene) {
  const BoundProblem p = scene.problem();
  const int per_body = kBody * kLooks + 6;
  const int tags_at = 2 * per_body;
  MatrixXd information = MatrixXd::Zero(tags_at + 18, tags_at + 18);
  const auto know = [&](int at, int count, double sigma) {
    information.diagonal().segment(at, count).array() += 1 / (sigma * sigma);
  };
  for (int body = 0; body < 2; ++body) {
    const int first = body * per_body;
    const int camera = first + kBody * kLooks;
    // As CausalBound begins; the second body is unknown.
    know(first + kRotation, 2, 0.5);
    know(first + kVelocity, 3, 1.0);
    know(first + kBiasW, 3, 0.02);
    know(first + kBiasF, 3, 0.2);
    know(camera, 3, p.camera.position_sigma_m);
    know(camera + 3, 3, p.camera.rotation_sigma_rad);
    if (body == 0) {
      constexpr double kExact = 1e-5;
      know(first + kRotation + 2, 1, kExact);
      know(first + kPosition, 3, kExact);
    }
    for (int k = 0; k < kLooks; ++k) {
      const int now = first + kBody * k;
      if (k > 0) {
        const InertialStep step =
            inertial_step(scene.truth(body, k - 1), scene.truth(body, k), p.imu, p.gravity_m_s2);
        Eigen::Matrix<double, 15, 30> J;
        J << step.Phi, -Matrix15::Identity();
        information.block<30, 30>(now - kBody, now - kBody) +=
            J.transpose() * step.Q.ldlt().solve(J);
      }
      for (const int id : body == 0 ? kOfFirst : kOfSecond) {
        const int tag = id == 4 ? 0 : id == 9 ? 1 : 2;
        const CornerRows rows =
            corner_rows(scene.truth(body, k).X_WB, p.camera, p.tags[static_cast<std::size_t>(tag)],
                        p.corner_noise_px);
        MatrixXd J = MatrixXd::Zero(8, information.cols());
        J.middleCols<3>(now + kRotation) = rows.rotation;
        J.middleCols<3>(now + kPosition) = rows.position;
        J.middleCols<6>(camera) = rows.extrinsics;
        J.middleCols<6>(tags_at + 6 * tag) = rows.tag;
        information += J.transpose() * J;
      }
    }
  }
  const MatrixXd P =
      information.ldlt().solve(MatrixXd::Identity(information.rows(), information.cols()));
  return P.bottomRightCorner(18, 18);
}

TEST_F(JointMapBoundTest, OfTwoBodiesIsThatOfTheWholeProblem) {
  const JointMap map = scene_.map(scene_.both());
  const MatrixXd at_once = tags_at_once(scene_);
  ASSERT_EQ(map.tags.size(), 3u);
  // The big matrix holds numbers from 1e-5² to 10².
  constexpr double kRoundingOfAll = 1e-4;
  for (std::size_t i = 1; i < 3; ++i) {
    const auto at = static_cast<Eigen::Index>(6 * i);
    expect_near(map.P.block<6, 6>(at, at), against_first(at_once, map.tags, i), kRoundingOfAll);
  }
}

TEST_F(JointMapBoundTest, FixesPlaceAndHeadingOfTheReferenceTag) {
  const JointMap map = scene_.map(scene_.both());
  const Eigen::Quaterniond q = map.tags.front().X_WT.q;
  const Eigen::RowVector3d heading = heading_row(q, heading_axis(q));
  const double tilt = map.P.block<3, 3>(3, 3).trace();
  EXPECT_GT(tilt, 1e-8);
  EXPECT_LT((map.P.topLeftCorner<3, 3>().trace()), kRounding * tilt);
  EXPECT_LT((heading * map.P.block<3, 3>(3, 3) * heading.transpose()).value(), kRounding * tilt);
}

TEST_F(JointMapBoundTest, LeavesOutABodyThatSharesNoTag) {
  const std::vector<TagsCovariance> bodies{scene_.knowledge(0, kOfFirst),
                                           scene_.knowledge(1, {14})};
  const JointMap map = scene_.map(bodies);
  ASSERT_EQ(map.tags.size(), 2u);
  const JointMap alone = scene_.map(std::span(bodies).first(1));
  expect_near(map.P, alone.P, kRounding);
}

TEST_F(JointMapBoundTest, FitsItsMapToTheTruthAsScoresDo) {
  const JointMap map = scene_.map(scene_.both());
  // Each column is an error; all of them together have the map's covariance. So small that it is
  // linear.
  constexpr double kSmall = 1e-4;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(map.P);
  const MatrixXd errors =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  double squares = 0;
  for (Eigen::Index k = 0; k < errors.cols(); ++k) {
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
    for (std::size_t i = 0; i < map.tags.size(); ++i) {
      const Eigen::Vector3d& p = map.tags[i].X_WT.p;
      points.emplace_back(p + kSmall * errors.col(k).segment<3>(6 * static_cast<Eigen::Index>(i)),
                          p);
    }
    const Pose level = fit_yaw_and_shift(points);
    for (const auto& [found, truth] : points) squares += (level * found - truth).squaredNorm();
  }
  const double level_m = std::sqrt(squares / static_cast<double>(map.tags.size())) / kSmall;
  const std::vector<int> all{4, 9, 14};
  constexpr double kLinear = 1e-4;
  EXPECT_NEAR(figures_of(map, all).level_m, level_m, kLinear * level_m);
  EXPECT_LT(figures_of(map, all).level_m, figures_of(map, all).raw_m);
}

}  // namespace
}  // namespace fiducap::bound
