#include "simulation/truth_errors.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/pose.hpp"

namespace fiducap {

Vector6d pose_error(const Pose& estimate, const Pose& truth) {
  Vector6d e;
  e << estimate.p - truth.p, log_so3(estimate.q * truth.q.conjugate());
  return e;
}

double normalised(const Eigen::VectorXd& e, const Eigen::MatrixXd& P) {
  return e.dot(P.ldlt().solve(e));
}

MapErrors map_errors(std::span<const KnownTag> map, const EstimationData& data, const Pose& X_WR,
                     const Pose& X_WT) {
  const Pose X_WT_true = X_WR * data.tag(data.reference_tag)->X_WT;
  MapErrors out;
  for (const KnownTag& entry : map) {
    const RecordedTag* tag = data.tag(entry.tag_id);
    if (tag == nullptr) continue;
    const Pose truth = X_WR * tag->X_WT;
    const Vector6d level = pose_error(entry.X_WT, truth);
    out.position_m += level.head<3>().squaredNorm();
    out.rotation_rad += level.tail<3>().squaredNorm();
    out.ids.push_back(tag->tag_id);
    if (tag->tag_id == data.reference_tag) continue;
    const Vector6d near = pose_error(X_WT.inverse() * entry.X_WT, X_WT_true.inverse() * truth);
    out.near_position_m += near.head<3>().squaredNorm();
    out.near_rotation_rad += near.tail<3>().squaredNorm();
    out.nees += normalised(level, entry.covariance) / 6;
    ++out.others;
  }
  const double n = static_cast<double>(std::max<std::size_t>(1, out.ids.size()));
  const double others = std::max(1, out.others);
  out.position_m = std::sqrt(out.position_m / n);
  out.rotation_rad = std::sqrt(out.rotation_rad / n);
  out.near_position_m = std::sqrt(out.near_position_m / others);
  out.near_rotation_rad = std::sqrt(out.near_rotation_rad / others);
  out.nees /= others;
  return out;
}

}  // namespace fiducap
