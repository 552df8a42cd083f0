#include "estimation/world/pose_error.hpp"

#include <Eigen/LU>

#include "base/so3.hpp"

namespace fiducap::world {

Pose moved(const Pose& X, const Eigen::Ref<const Eigen::VectorXd>& error) {
  const Eigen::Vector3d phi = error.tail<3>();
  const Eigen::Quaterniond turn = exp_so3(phi);
  return {(turn * X.q).normalized(), turn * X.p + left_jacobian_so3(phi) * error.head<3>()};
}

Vector6d world_error_between(const Pose& from, const Pose& to) {
  const Eigen::Quaterniond turn = to.q * from.q.conjugate();
  Vector6d error;
  error.tail<3>() = log_so3(turn);
  error.head<3>() = left_jacobian_so3(error.tail<3>()).inverse() * (to.p - turn * from.p);
  return error;
}

Matrix6d adjoint(const Pose& X) {
  const Eigen::Matrix3d R = X.rotation();
  Matrix6d Ad;
  Ad << R, skew(X.p) * R, Eigen::Matrix3d::Zero(), R;
  return Ad;
}

Matrix6d plain_from_world_error(const Eigen::Vector3d& p) {
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = -skew(p);
  return J;
}

Matrix6d world_from_plain_error(const Eigen::Vector3d& p) {
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = skew(p);
  return J;
}

}  // namespace fiducap::world
