#include "estimation/filter/heading_rule.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace fiducap {

namespace {
// Vertical component above which a tag axis gives no heading.
constexpr double kSteep = 0.9;

constexpr std::size_t kTagsOfAPlane = 3;
// Scatter of the centres along the shorter side of their plane, above which they are used.
constexpr double kApart_m = 0.2;
// Length of the mean normal below which the normals disagree.
constexpr double kSameWay = 0.7;
// Smallest cosine between plane and normals: beyond, one of the tags lies on a table.
const double kPlaneIsFloor = std::cos(0.2);

Eigen::Quaterniond yaw(double angle) { return exp_so3({0, 0, angle}); }
}  // namespace

HeadingRule make_heading_rule(const WorkspaceGauge& gauge, const Eigen::Quaterniond& q_WT) {
  HeadingRule rule;
  const Eigen::Matrix3d R = gauge.X_WT ? gauge.X_WT->rotation() : q_WT.toRotationMatrix();
  while (rule.axis < 1 && std::abs(R(2, rule.axis)) > kSteep) ++rule.axis;
  if (gauge.X_WT) {
    rule.X_WT = *gauge.X_WT;
    rule.yaw_rad = std::atan2(R(1, rule.axis), R(0, rule.axis));
  }
  return rule;
}

Eigen::Quaterniond turn_to_heading(const HeadingRule& rule, const Eigen::Quaterniond& q_WT) {
  const Eigen::Vector3d h = q_WT * Eigen::Vector3d::Unit(rule.axis);
  return yaw(rule.yaw_rad - std::atan2(h.y(), h.x()));
}

Eigen::Quaterniond turn_closest(const Eigen::Quaterniond& wanted_q_WT,
                                const Eigen::Quaterniond& q_WT) {
  const Eigen::Matrix3d M = (wanted_q_WT * q_WT.conjugate()).toRotationMatrix();
  return yaw(std::atan2(M(1, 0) - M(0, 1), M(0, 0) + M(1, 1)));
}

Pose axes_between(const Pose& from, const Pose& to, bool level) {
  const Eigen::Quaterniond turn =
      level ? turn_closest(to.q, from.q) : (to.q * from.q.conjugate()).normalized();
  return {turn, to.p - turn * from.p};
}

std::optional<Eigen::Vector3d> up_by_floor(std::span<const Pose> X_AT) {
  if (X_AT.empty()) return std::nullopt;
  const auto count = static_cast<double>(X_AT.size());
  Eigen::Vector3d face = Eigen::Vector3d::Zero();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Pose& tag : X_AT) {
    face += tag.q * Eigen::Vector3d::UnitZ() / count;
    centre += tag.p / count;
  }
  if (!(face.norm() > kSameWay)) return std::nullopt;
  face.normalize();
  if (X_AT.size() < kTagsOfAPlane) return face;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Pose& tag : X_AT) scatter += (tag.p - centre) * (tag.p - centre).transpose() / count;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  if (!(eigen.eigenvalues()(1) > kApart_m * kApart_m)) return face;
  const Eigen::Vector3d plane = eigen.eigenvectors().col(0);
  const double along = plane.dot(face);
  if (std::abs(along) < kPlaneIsFloor) return face;
  return along > 0 ? plane : Eigen::Vector3d(-plane);
}

Eigen::Quaterniond upright_attitude(const Eigen::Quaterniond& q_AT, const Eigen::Vector3d& up_A) {
  const Eigen::Quaterniond level = rotation_between(up_A, Eigen::Vector3d::UnitZ()) * q_AT;
  return (turn_to_heading(make_heading_rule({}, level), level) * level).normalized();
}

}  // namespace fiducap
