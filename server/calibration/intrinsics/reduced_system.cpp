#include "calibration/intrinsics/reduced_system.hpp"

#include <limits>
#include <map>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "base/so3.hpp"
#include "calibration/intrinsics/lens_derivative.hpp"

namespace fiducap {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix2Xd = Eigen::Matrix<double, 2, Eigen::Dynamic>;

/// Diagonal 1: focal lengths and k4 differ by 1e8 in size.
Eigen::VectorXd scale_of(const Eigen::MatrixXd& S) {
  return S.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
}

}  // namespace

struct ReducedSystem::Share {
  Matrix6d H_pose{Matrix6d::Zero()};
  Vector6d g_pose{Vector6d::Zero()};
  Eigen::MatrixXd H_cross;
};

ReducedSystem::ReducedSystem(const CalibrationData& data, const CalibrationState& state,
                             const std::vector<int>& free, int shaped)
    : data_(data), state_(state), free_(free), shaped_(shaped), column_(data.targets.size(), -1) {
  size_ = static_cast<Eigen::Index>(free.size());
  for (std::size_t t = 0; t < data.targets.size(); ++t)
    if (!state.defines_group(t) && is_seen(t)) {
      column_[t] = size_;
      size_ += 6;
    }
  if (shaped_ >= 0) {
    half_side_ = half_side(data.targets[static_cast<std::size_t>(shaped_)], middle_);
    size_ += kShapeNumbers;
  }
  S_ = Eigen::MatrixXd::Zero(size_, size_);
  for (std::size_t v = 0; v < data.views.size(); ++v) add_view(v);
}

bool ReducedSystem::is_seen(std::size_t target) const {
  for (const CalibrationView& view : data_.views)
    for (const TargetSighting& sighting : view.sightings)
      if (sighting.target == static_cast<int>(target)) return true;
  return false;
}

void ReducedSystem::add_view(std::size_t v) {
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(size_);
  std::map<int, Share> shares;
  for (const TargetSighting& sighting : data_.views[v].sightings) {
    const int group = state_.group_of[static_cast<std::size_t>(sighting.target)];
    Share& share = shares[group];
    if (share.H_cross.size() == 0) share.H_cross = Eigen::MatrixXd::Zero(size_, 6);
    for (const SeenPoint& seen : sighting.points)
      add_point(seen, static_cast<std::size_t>(sighting.target), state_.X_VG[v].at(group), share,
                pull);
  }
  for (const auto& [group, share] : shares) {
    const Eigen::LDLT<Matrix6d> H(share.H_pose);
    S_.noalias() -= share.H_cross * H.solve(share.H_cross.transpose());
    pull.noalias() -= share.H_cross * H.solve(share.g_pose);
    freedom_ -= 6;
  }
  if (!shares.empty()) pulls_.push_back(std::move(pull));
}

void ReducedSystem::add_point(const SeenPoint& seen, std::size_t target, const Pose& X_VG,
                              Share& share, Eigen::VectorXd& pull) {
  const Eigen::Vector3d p_T = data_.targets[target].points[static_cast<std::size_t>(seen.point)];
  const Eigen::Vector3d turned_GT = state_.X_GT[target].q * p_T;
  const Eigen::Vector3d turned_VG = X_VG.q * (turned_GT + state_.X_GT[target].p);
  const LensDerivative at = differentiate(state_.camera, turned_VG + X_VG.p);
  const Eigen::Vector2d y = seen.px - at.px;
  squares_ += y.squaredNorm();
  freedom_ += 2;
  Eigen::Matrix<double, 2, 6> J_pose;
  J_pose << at.d_point, -at.d_point * skew(turned_VG);
  Matrix2Xd J_lens(2, free_.size());
  for (std::size_t i = 0; i < free_.size(); ++i)
    J_lens.col(static_cast<Eigen::Index>(i)) = at.d_lens.col(free_[i]);
  const Eigen::Index n = J_lens.cols();
  share.H_pose += J_pose.transpose() * J_pose;
  share.g_pose += J_pose.transpose() * y;
  share.H_cross.topRows(n) += J_lens.transpose() * J_pose;
  S_.topLeftCorner(n, n) += J_lens.transpose() * J_lens;
  pull.head(n) += J_lens.transpose() * y;
  const Eigen::Matrix<double, 2, 3> to_group = at.d_point * X_VG.rotation();
  if (column_[target] >= 0) {
    Eigen::Matrix<double, 2, 6> J_target;
    J_target << to_group, -to_group * skew(turned_GT);
    add_block(column_[target], J_target, J_lens, J_pose, y, share, pull);
  }
  if (static_cast<int>(target) == shaped_)
    add_block(size_ - kShapeNumbers, to_group * state_.X_GT[target].rotation() * shape_at(p_T),
              J_lens, J_pose, y, share, pull);
}

void ReducedSystem::add_block(Eigen::Index column, const Matrix2Xd& J, const Matrix2Xd& J_lens,
                              const Eigen::Matrix<double, 2, 6>& J_pose, const Eigen::Vector2d& y,
                              Share& share, Eigen::VectorXd& pull) {
  const Eigen::Index n = J_lens.cols();
  const Eigen::Index m = J.cols();
  share.H_cross.middleRows(column, m) += J.transpose() * J_pose;
  S_.block(column, column, m, m) += J.transpose() * J;
  S_.block(0, column, n, m) += J_lens.transpose() * J;
  S_.block(column, 0, m, n) += J.transpose() * J_lens;
  pull.segment(column, m) += J.transpose() * y;
}

Eigen::Matrix<double, 3, kShapeNumbers> ReducedSystem::shape_at(const Eigen::Vector3d& p_T) const {
  const double x = p_T.x() - middle_.x();
  const double y = p_T.y() - middle_.y();
  const double along = x / half_side_;
  const double up = y / half_side_;
  Eigen::Matrix<double, 3, kShapeNumbers> d;
  d << 0, 0, 0, x / 2, y / 2,  //
      0, 0, 0, -y / 2, x / 2,  //
      half_side_ * along * along, half_side_ * along * up, half_side_ * up * up, 0, 0;
  return d;
}

bool ReducedSystem::invert(Eigen::MatrixXd& inverse) const {
  const Eigen::VectorXd scale = scale_of(S_);
  const Eigen::MatrixXd scaled = scale.asDiagonal() * S_ * scale.asDiagonal();
  const Eigen::LDLT<Eigen::MatrixXd> solver(scaled);
  constexpr double kSingular = 1e-13;
  if (solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > kSingular)) return false;
  inverse = scale.asDiagonal() *
            solver.solve(Eigen::MatrixXd::Identity(scaled.rows(), scaled.rows())) *
            scale.asDiagonal();
  return true;
}

double ReducedSystem::condition() const {
  const Eigen::VectorXd scale = scale_of(S_);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      scale.asDiagonal() * S_ * scale.asDiagonal(), Eigen::EigenvaluesOnly);
  if (solver.info() != Eigen::Success || !(solver.eigenvalues()(0) > 0))
    return std::numeric_limits<double>::infinity();
  return solver.eigenvalues().tail<1>()(0) / solver.eigenvalues()(0);
}

double half_side(const CalibrationTarget& target, Eigen::Vector3d& middle) {
  Eigen::Vector3d low = target.points.front();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& p : target.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  middle = (low + high) / 2;
  return (high - low).maxCoeff() / 2;
}

}  // namespace fiducap
