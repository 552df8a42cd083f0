// The recursive bound against one big information matrix of a toy problem: two tags, a few images.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "base/pose.hpp"
#include "simulation/estimation_data.hpp"
#include "support/bound/causal_bound.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap::bound {
namespace {

constexpr int kBoundImages = 6;
constexpr double kInterval_s = 0.05;
constexpr double kFades_s = 0.08;

/// A body that turns and accelerates in front of two tags.
TruthSample truth(int k) {
  const double t = k * kInterval_s;
  TruthSample s;
  s.at = instant_from_ns(0) + from_seconds(t);
  s.X_WB = {exp_so3({0.2 * t, 0.5 * t, -0.6 * t}), {0.4 * t * t, -0.3 * t, 0.2 * t * t}};
  s.v_WB = {0.8 * t, -0.3, 0.4 * t};
  return s;
}

BoundProblem problem(char letter) {
  BoundProblem p;
  p.camera = forward_mount();
  p.imu = ImuNoise{1e-3, 1e-4, 1e-2, 1e-3, 200};
  Eigen::Matrix3d facing;  // tag z against x, tag y up
  facing << 0, 0, -1, -1, 0, 0, 0, 1, 0;
  const Eigen::Quaterniond q(facing);
  p.tags = {{4, 0.2, {q * exp_so3({0.4, 0.2, 0}), {1.5, 0.2, 0.1}}, 0, 0},
            {9, 0.2, {q * exp_so3({-0.3, 0.5, 0.4}), {1.7, -0.3, 0.2}}, 0, 0}};
  p.reference_tag = 4;
  p.map_known = letter == 'C' || letter == 'D';
  p.extrinsics_known = letter == 'B' || letter == 'D';
  return p;
}

/// Root of the covariance of lasting errors of a tag's corners.
Matrix8 lasting_root() {
  Matrix8 out;
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) out(i, j) = i == j ? 0.5 : 0.1 * std::sin(i + 3 * j);
  return out;
}

/// Tags in image k: the second one joins later, and one image is empty.
std::vector<int> seen(int k) {
  if (k == 3) return {};
  return k < 2 ? std::vector<int>{4} : std::vector<int>{9, 4};
}

/// All states at once: body states of all images, extrinsics, tags. Sums information; gives the
/// marginal of an image.
class WholeProblem {
 public:
  explicit WholeProblem(const BoundProblem& p) : p_(p) {
    const int tags = p.map_known ? 0 : 12;
    first_lasting_ = kBody * kBoundImages + 6 + tags;
    const int size = first_lasting_ + 2 * 8 * kBoundImages;
    information_.setZero(size, size);
    start();
    for (const int id : {4, 9}) fade(id);
    for (int k = 0; k < kBoundImages; ++k) {
      if (k > 0) motion(k);
      for (const int id : seen(k)) corners(k, id);
    }
  }
  /// Body (rotation, position) at an image, then tag (position, rotation).
  [[nodiscard]] Eigen::Matrix<double, 12, 12> body_and_tag(int image, int id) const {
    const Eigen::MatrixXd P = information_.ldlt().solve(
        Eigen::MatrixXd::Identity(information_.rows(), information_.cols()));
    const int body = kBody * image;
    std::vector<int> index;
    for (const int at : {body + kRotation, body + kPosition})
      for (int i = 0; i < 3; ++i) index.push_back(at + i);
    Eigen::Matrix<double, 12, 12> out = Eigen::Matrix<double, 12, 12>::Zero();
    if (p_.map_known) {
      out.topLeftCorner<6, 6>() = marginal(P, index);
      return out;
    }
    for (int i = 0; i < 6; ++i) index.push_back(tag_at(id) + i);
    return marginal(P, index);
  }

 private:
  [[nodiscard]] static int extrinsics_at() { return kBody * kBoundImages; }
  [[nodiscard]] static int tag_at(int id) { return extrinsics_at() + 6 + (id == 4 ? 0 : 6); }

  void know(int at, int count, double sigma) {
    information_.diagonal().segment(at, count).array() += 1 / (sigma * sigma);
  }

  /// The prior of the recursion; exact quantities have a far smaller sigma than all others.
  void start() {
    constexpr double kExact = 1e-6;
    know(kRotation, 2, 0.5);
    know(kRotation + 2, 1, p_.map_known ? 3.0 : kExact);
    know(kVelocity, 3, 1.0);
    know(kPosition, 3, p_.map_known ? 10.0 : kExact);
    know(kBiasW, 3, 0.02);
    know(kBiasF, 3, 0.2);
    know(extrinsics_at(), 3, p_.extrinsics_known ? kExact : p_.camera.position_sigma_m);
    know(extrinsics_at() + 3, 3, p_.extrinsics_known ? kExact : p_.camera.rotation_sigma_rad);
  }

  /// The tag's lasting errors in image k; without an image they are a prior.
  [[nodiscard]] int lasting_at(int k, int id) const {
    return first_lasting_ + 8 * (2 * k + (id == 4 ? 0 : 1));
  }

  /// From image to image; image 3 shows nothing and ends the visits.
  void fade(int id) {
    const double a = std::exp(-kInterval_s / kFades_s);
    know(lasting_at(0, id), 8, 1.0);
    for (int k = 1; k < kBoundImages; ++k) {
      if (k == 4) {
        know(lasting_at(k, id), 8, 1.0);
        continue;
      }
      const double weight = 1 / (1 - a * a);
      const int before = lasting_at(k - 1, id);
      const int now = lasting_at(k, id);
      information_.diagonal().segment<8>(before).array() += a * a * weight;
      information_.diagonal().segment<8>(now).array() += weight;
      for (int i = 0; i < 8; ++i) {
        information_(before + i, now + i) -= a * weight;
        information_(now + i, before + i) -= a * weight;
      }
    }
  }

  void motion(int k) {
    const InertialStep step = inertial_step(truth(k - 1), truth(k), p_.imu, p_.gravity_m_s2);
    Eigen::Matrix<double, 15, 30> J;
    J << step.Phi, -Matrix15::Identity();
    information_.block<30, 30>(kBody * (k - 1), kBody * (k - 1)) +=
        J.transpose() * step.Q.ldlt().solve(J);
  }

  void corners(int k, int id) {
    const RecordedTag& tag = p_.tags[id == 4 ? 0 : 1];
    const CornerRows rows = corner_rows(truth(k).X_WB, p_.camera, tag, p_.corner_noise_px);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(8, information_.cols());
    J.middleCols<3>(kBody * k + kRotation) = rows.rotation;
    J.middleCols<3>(kBody * k + kPosition) = rows.position;
    J.middleCols<6>(extrinsics_at()) = rows.extrinsics;
    if (!p_.map_known) J.middleCols<6>(tag_at(id)) = rows.tag;
    if (p_.lasting) J.middleCols<8>(lasting_at(k, id)) = lasting_root();
    information_ += J.transpose() * J;
  }

  BoundProblem p_;
  int first_lasting_{};
  Eigen::MatrixXd information_;
};

class TwoTags : public testing::TestWithParam<char> {};

/// Relative to a tag, which removes the gauge (with its sigma of 1e-6).
void expect_equal(const Matrix12& recursive, const Matrix12& at_once, int image,
                  const RecordedTag& tag) {
  const RelativeRows J = relative_to_tag(truth(image).X_WB, tag.X_WT);
  const Eigen::Matrix<double, 6, 6> a = J * recursive * J.transpose();
  const Eigen::Matrix<double, 6, 6> b = J * at_once * J.transpose();
  // The big matrix holds numbers from 1e-6² to 10²; half of the digits remain.
  constexpr double kRounding = 1e-5;
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), kRounding * b.cwiseAbs().maxCoeff()) << a << "\n\n" << b;
}

/// Recursive and at once, relative to each tag, at the end.
void expect_equal(const BoundProblem& p) {
  CausalBound bound(p);
  for (int k = 0; k < kBoundImages; ++k) {
    bound.move_to(truth(k));
    std::vector<TagSight> sights;
    for (const int id : seen(k))
      sights.push_back({id, Matrix8::Identity() / p.corner_noise_px, lasting_root()});
    bound.see(sights);
  }
  const WholeProblem whole(p);
  for (const RecordedTag& tag : p.tags) {
    const int last = kBoundImages - 1;
    expect_equal(bound.body_and_tag(tag.tag_id), whole.body_and_tag(last, tag.tag_id), last, tag);
  }
}

TEST_P(TwoTags, HaveTheCovarianceOfTheWholeProblem) { expect_equal(problem(GetParam())); }

TEST_P(TwoTags, HaveItWithLastingErrors) {
  BoundProblem p = problem(GetParam());
  p.lasting = LastingErrors{.fades_s = kFades_s, .visit_ends = from_seconds(1.5 * kInterval_s)};
  expect_equal(p);
}

INSTANTIATE_TEST_SUITE_P(Cases, TwoTags, testing::Values('A', 'B', 'C', 'D'));

TEST(CausalBound, IsUnknownBeforeTheReferenceTagIsSeen) {
  CausalBound bound(problem('A'));
  EXPECT_FALSE(bound.now().has_value());
  bound.move_to(truth(0));
  bound.see(std::vector<int>{9});
  EXPECT_FALSE(bound.now().has_value());
  bound.move_to(truth(1));
  bound.see(std::vector<int>{4});
  EXPECT_TRUE(bound.now().has_value());
}

}  // namespace
}  // namespace fiducap::bound
