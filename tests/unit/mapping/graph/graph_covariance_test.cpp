// W is defined by the mean of tags: against a dense computation.
#include "mapping/graph/graph_covariance.hpp"

#include <gtest/gtest.h>

#include <random>

#include <Eigen/LU>

#include "base/pose.hpp"
#include "estimation/world/filter_state.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {
namespace {

using Points = std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>;

Eigen::Vector3d draw(double scale, std::mt19937_64& random) {
  std::normal_distribution<double> gauss(0, scale);
  const double x = gauss(random);
  const double y = gauss(random);
  return {x, y, gauss(random)};
}

double misfit(const Points& points, const Pose& X) {
  double sum = 0;
  for (const auto& [from, to] : points) sum += (X * from - to).squaredNorm();
  return sum;
}

TEST(FitYawAndShift, FindsYawAndShift) {
  std::mt19937_64 random(1);
  for (const double yaw : {0.0, 0.7, 3.0, -2.5}) {
    const Pose X{exp_so3({0, 0, yaw}), {12, -7, 3}};
    Points points;
    for (int i = 0; i < 5; ++i) {
      const Eigen::Vector3d p = draw(4, random);
      points.emplace_back(p, X * p);
    }
    const Pose found = fit_yaw_and_shift(points);
    EXPECT_LT((found.p - X.p).norm(), 1e-12);
    EXPECT_LT(angle_between(found.q, X.q), 1e-12);
  }
}

TEST(FitYawAndShift, IsLeastSquares) {
  constexpr double kStep = 1e-3;
  std::mt19937_64 random(2);
  Points points;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Vector3d p = draw(4, random);
    points.emplace_back(p, exp_so3({0.1, -0.2, 1.0}) * p + draw(0.3, random));
  }
  const Pose best = fit_yaw_and_shift(points);
  EXPECT_LT(best.q.vec().head<2>().norm(), 1e-15) << "the vertical is fixed";
  for (const Eigen::Vector4d& step :
       {Eigen::Vector4d(kStep, 0, 0, 0), Eigen::Vector4d(0, kStep, 0, 0),
        Eigen::Vector4d(0, 0, kStep, 0), Eigen::Vector4d(0, 0, 0, kStep)}) {
    for (const double sign : {-1.0, 1.0}) {
      const Pose other{exp_so3({0, 0, sign * step(3)}) * best.q, best.p + sign * step.head<3>()};
      EXPECT_GT(misfit(points, other), misfit(points, best)) << sign * step.transpose();
    }
  }
}

TEST(FitYawAndShift, KeepsTheHeadingOfASinglePoint) {
  const Pose found = fit_yaw_and_shift(Points{{{1, 2, 3}, {4, 4, 4}}});
  EXPECT_LT(angle_between(found.q, Eigen::Quaterniond::Identity()), 1e-15);
  EXPECT_LT((found.p - Eigen::Vector3d(3, 2, 1)).norm(), 1e-15);
  const Pose none = fit_yaw_and_shift({});
  EXPECT_EQ(none.p, Eigen::Vector3d::Zero());
}

/// Tags of a level room with unobservable common shift and yaw; one of them is held.
class DatumTest : public testing::Test {
 protected:
  static constexpr int kTags = 5;
  // A body's 15 numbers precede the tags, so that rows and variables differ.
  static constexpr int kFirstTag = 1;

  DatumTest() {
    std::mt19937_64 random(3);
    for (int i = 0; i < kTags; ++i)
      poses_.push_back({exp_so3(draw(0.5, random)), draw(5, random) + Eigen::Vector3d(20, 0, 1)});
    const Eigen::MatrixXd N = common_shift_and_yaw();
    std::normal_distribution<double> gauss;
    const int rows = 15 + 6 * kTags;
    const Eigen::MatrixXd seen =
        Eigen::MatrixXd::NullaryExpr(2 * rows, rows, [&] { return gauss(random); });
    const Eigen::MatrixXd blind =
        Eigen::MatrixXd::Identity(rows, rows) - N * (N.transpose() * N).inverse() * N.transpose();
    information_ = blind * seen.transpose() * seen * blind;
  }

  /// Of a body and the tags: place and turn about z of all, on the world's side.
  static Eigen::MatrixXd common_shift_and_yaw() {
    Eigen::MatrixXd N = Eigen::MatrixXd::Zero(15 + 6 * kTags, 4);
    for (int i = -1; i < kTags; ++i) {
      const int at = i < 0 ? 0 : 15 + 6 * i;
      N.block<3, 3>(at, 0).setIdentity();
      N(at + 5, 3) = 1;
    }
    return N;
  }

  [[nodiscard]] Eigen::MatrixXd held(int tag) const {
    Eigen::MatrixXd H = information_;
    const int at = 15 + 6 * tag;
    for (const int i : {0, 1, 2, 5}) H(at + i, at + i) += 1e3;
    return H;
  }

  [[nodiscard]] static BlockMatrix blocks_of(const Eigen::MatrixXd& H) {
    std::vector<int> sizes{15};
    sizes.insert(sizes.end(), kTags, 6);
    BlockMatrix out(sizes);
    for (int row = 0; row < out.variables(); ++row)
      for (int column = 0; column <= row; ++column)
        out.add(row, column,
                H.block(out.first(row), out.first(column), out.size(row), out.size(column)));
    return out;
  }

  /// The mean's shift and yaw, by how places (and, of a single tag, its heading) change when every
  /// tag is moved a little.
  [[nodiscard]] Eigen::MatrixXd mean_of(const std::vector<int>& defining) const {
    constexpr double kStep = 1e-6;
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const int i : defining) middle += pose(i).p / static_cast<double>(defining.size());
    Eigen::MatrixXd Bt = Eigen::MatrixXd::Zero(4, 15 + 6 * kTags);
    for (const int i : defining) {
      for (int k = 0; k < 6; ++k) {
        const Vector6d error = kStep * Vector6d::Unit(k);
        const Eigen::Vector3d rho = error.head<3>();
        const Eigen::Vector3d phi = error.tail<3>();
        const Eigen::Vector3d moved = exp_so3(phi) * pose(i).p + rho - pose(i).p;
        const Eigen::Vector3d arm = pose(i).p - middle;
        const double turn =
            defining.size() == 1 ? phi.z() : arm.x() * moved.y() - arm.y() * moved.x();
        Bt.block<3, 1>(0, 15 + 6 * i + k) = moved / kStep;
        Bt(3, 15 + 6 * i + k) = turn / kStep;
      }
    }
    return Bt;
  }

  [[nodiscard]] Eigen::MatrixXd dense(const std::vector<int>& defining, int held_tag) const {
    const Eigen::MatrixXd N = common_shift_and_yaw();
    const Eigen::MatrixXd Bt = mean_of(defining);
    const Eigen::MatrixXd S =
        Eigen::MatrixXd::Identity(N.rows(), N.rows()) - N * (Bt * N).inverse() * Bt;
    return S * held(held_tag).inverse() * S.transpose();
  }

  [[nodiscard]] Matrix6d found(const std::vector<int>& defining, int held_tag, int i, int j) const {
    const BlockMatrix H = blocks_of(held(held_tag));
    auto factor = BlockCholesky::factor(H);
    factor->invert();
    std::vector<std::pair<int, Pose>> tags;
    for (const int k : defining) tags.emplace_back(kFirstTag + k, pose(k));
    const Datum datum(tags, *factor, H);
    return datum.between({kFirstTag + i}, {kFirstTag + j},
                         *factor->inverse(kFirstTag + i, kFirstTag + j));
  }

  [[nodiscard]] const Pose& pose(int i) const { return poses_[static_cast<std::size_t>(i)]; }

  std::vector<Pose> poses_;
  Eigen::MatrixXd information_;
};

// The dense one takes differences of the mean.
constexpr double kDifferences = 1e-6;

TEST_F(DatumTest, GivesErrorsRelativeToTheMean) {
  for (const std::vector<int>& defining :
       {std::vector<int>{0, 1, 2, 3, 4}, std::vector<int>{1, 3}, std::vector<int>{2}}) {
    const Eigen::MatrixXd expected = dense(defining, 0);
    const double scale = expected.bottomRightCorner(6 * kTags, 6 * kTags).cwiseAbs().maxCoeff();
    for (int i = 0; i < kTags; ++i) {
      for (int j = 0; j < kTags; ++j) {
        const Matrix6d block = expected.block<6, 6>(15 + 6 * i, 15 + 6 * j);
        EXPECT_LT((found(defining, 0, i, j) - block).cwiseAbs().maxCoeff(), kDifferences * scale)
            << defining.size() << " tags define, block " << i << " " << j;
      }
    }
  }
}

TEST_F(DatumTest, DoesNotDependOnTheHeldTag) {
  for (const std::vector<int>& defining : {std::vector<int>{0, 1, 2, 3, 4}, std::vector<int>{2}}) {
    const Matrix6d one = found(defining, 0, 1, 3);
    const Matrix6d other = found(defining, 4, 1, 3);
    EXPECT_LT((one - other).cwiseAbs().maxCoeff(), 1e-8 * one.cwiseAbs().maxCoeff());
  }
}

TEST_F(DatumTest, FixesPlaceAndHeadingOfASingleTag) {
  const Matrix6d covariance = world::plain_from_world_error(pose(2).p) * found({2}, 0, 2, 2) *
                              world::plain_from_world_error(pose(2).p).transpose();
  const Eigen::Matrix3d of_place = covariance.topLeftCorner<3, 3>();
  EXPECT_LT(of_place.norm(), 1e-9);
  EXPECT_LT(covariance(5, 5), 1e-9);
  EXPECT_GT(covariance(3, 3), 1e-6) << "its tilt is measured, not defined";
}

}  // namespace
}  // namespace fiducap
