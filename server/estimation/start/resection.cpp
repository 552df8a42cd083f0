#include "estimation/start/resection.hpp"

#include <Eigen/Cholesky>

#include "base/so3.hpp"
#include "detection/corner_projection.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

namespace {
constexpr int kSteps = 6;
constexpr double kLargestStep = 1.0;
constexpr double kConverged = 1e-9;
}  // namespace

Pose resect(Pose X_AB, std::span<const SightedTag> tags, double inlier_px) {
  const double limit = 8 * inlier_px * inlier_px;
  for (int step = 0; step < kSteps; ++step) {
    Matrix6d A = Matrix6d::Zero();
    Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
    for (const SightedTag& tag : tags) {
      const Pose X_BT = X_AB.inverse() * tag.X_AT;
      const CornerResidual r =
          corner_residual(*tag.seen, tag.X_BV.inverse() * X_BT, *tag.camera, 1.0, tag.k1);
      if (!r.in_front || r.y.squaredNorm() > limit) continue;
      const Eigen::Matrix3d R_VB = tag.X_BV.rotation().transpose();
      const Eigen::Matrix<double, 8, 3> H_p = r.H.leftCols<3>() * R_VB;
      const Eigen::Matrix<double, 8, 3> H_q = r.H.rightCols<3>() * R_VB;
      Matrix86d H;
      H << -H_p, H_p * skew(X_BT.p) - H_q;
      A.noalias() += H.transpose() * H;
      b.noalias() += H.transpose() * r.y;
    }
    if (A.isZero(0)) return X_AB;
    const Eigen::Matrix<double, 6, 1> d = A.ldlt().solve(b);
    if (!d.allFinite() || d.norm() > kLargestStep) return X_AB;
    X_AB.p += X_AB.q * d.head<3>();
    X_AB.q = (X_AB.q * exp_so3(d.tail<3>())).normalized();
    if (d.norm() < kConverged) break;
  }
  return X_AB;
}

}  // namespace fiducap
