#include "estimation/filter/floor.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "base/so3.hpp"
#include "estimation/filter/heading_rule.hpp"

namespace fiducap {

namespace {

constexpr std::size_t kTagsOfAPlane = 3;
// Scatter of the centres along the plane's shorter side, from which on they beat the faces.
constexpr double kApart_m = 0.2;
// Faces that lie flat look the same way; shorter than this, their mean says nothing.
constexpr double kSameWay = 0.7;
// A plane further from the faces than this is no floor: one of the tags lies on a table.
const double kPlaneIsFloor = std::cos(0.2);

}  // namespace

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
  const Eigen::Quaterniond level =
      Eigen::Quaterniond::FromTwoVectors(up_A, Eigen::Vector3d::UnitZ()) * q_AT;
  return (turn_to_heading(make_heading_rule({}, level), level) * level).normalized();
}

}  // namespace fiducap
