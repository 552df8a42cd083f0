#include "calibration/intrinsics/lens_covariance.hpp"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "base/so3.hpp"
#include "calibration/intrinsics/lens_derivative.hpp"

namespace fiducap {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Normal equations with the poses of views taken out (Schur complement): lens first, then targets.
class ReducedSystem final {
 public:
  ReducedSystem(const CalibrationData& data, const CalibrationState& state,
                const std::vector<int>& free)
      : data_(data), state_(state), free_(free), column_(data.targets.size(), -1) {
    size_ = static_cast<Eigen::Index>(free.size());
    for (std::size_t t = 0; t < data.targets.size(); ++t)
      if (!state.defines_group(t) && is_seen(t)) {
        column_[t] = size_;
        size_ += 6;
      }
    S_ = Eigen::MatrixXd::Zero(size_, size_);
    for (std::size_t v = 0; v < data.views.size(); ++v) add_view(v);
  }

  [[nodiscard]] const Eigen::MatrixXd& information() const { return S_; }
  /// Per view: the gradient of its own squared residuals / 2, poses taken out.
  [[nodiscard]] const std::vector<Eigen::VectorXd>& pulls() const { return pulls_; }

 private:
  /// What one group in one view adds.
  struct Share {
    Matrix6d H_pose{Matrix6d::Zero()};
    Vector6d g_pose{Vector6d::Zero()};
    Eigen::MatrixXd H_cross;
  };

  [[nodiscard]] bool is_seen(std::size_t target) const {
    for (const CalibrationView& view : data_.views)
      for (const TargetSighting& sighting : view.sightings)
        if (sighting.target == static_cast<int>(target)) return true;
    return false;
  }

  void add_view(std::size_t v) {
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
    }
    if (!shares.empty()) pulls_.push_back(std::move(pull));
  }

  void add_point(const SeenPoint& seen, std::size_t target, const Pose& X_VG, Share& share,
                 Eigen::VectorXd& pull) {
    const Eigen::Vector3d p_T = data_.targets[target].points[static_cast<std::size_t>(seen.point)];
    const Eigen::Vector3d turned_GT = state_.X_GT[target].q * p_T;
    const Eigen::Vector3d turned_VG = X_VG.q * (turned_GT + state_.X_GT[target].p);
    const LensDerivative at = differentiate(state_.camera, turned_VG + X_VG.p);
    const Eigen::Vector2d y = seen.px - at.px;
    Eigen::Matrix<double, 2, 6> J_pose;
    J_pose << at.d_point, -at.d_point * skew(turned_VG);
    Eigen::Matrix<double, 2, Eigen::Dynamic> J_lens(2, free_.size());
    for (std::size_t i = 0; i < free_.size(); ++i)
      J_lens.col(static_cast<Eigen::Index>(i)) = at.d_lens.col(free_[i]);
    const Eigen::Index n = J_lens.cols();
    share.H_pose += J_pose.transpose() * J_pose;
    share.g_pose += J_pose.transpose() * y;
    share.H_cross.topRows(n) += J_lens.transpose() * J_pose;
    S_.topLeftCorner(n, n) += J_lens.transpose() * J_lens;
    pull.head(n) += J_lens.transpose() * y;
    const Eigen::Index column = column_[target];
    if (column < 0) return;
    const Eigen::Matrix<double, 2, 3> to_group = at.d_point * X_VG.rotation();
    Eigen::Matrix<double, 2, 6> J_target;
    J_target << to_group, -to_group * skew(turned_GT);
    share.H_cross.middleRows<6>(column) += J_target.transpose() * J_pose;
    S_.block<6, 6>(column, column) += J_target.transpose() * J_target;
    S_.block(0, column, n, 6) += J_lens.transpose() * J_target;
    S_.block(column, 0, 6, n) += J_target.transpose() * J_lens;
    pull.segment<6>(column) += J_target.transpose() * y;
  }

  const CalibrationData& data_;
  const CalibrationState& state_;
  const std::vector<int>& free_;
  std::vector<Eigen::Index> column_;
  Eigen::Index size_{0};
  Eigen::MatrixXd S_;
  std::vector<Eigen::VectorXd> pulls_;
};

/// Diagonal 1: focal lengths and k4 differ by 1e8 in size.
Eigen::VectorXd scale_of(const Eigen::MatrixXd& S) {
  return S.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
}

}  // namespace

LensUncertainty uncertainty_of(const CalibrationData& data, const CalibrationState& state,
                               const std::vector<int>& free, double sigma_px) {
  LensUncertainty out;
  const ReducedSystem system(data, state, free);
  const Eigen::VectorXd scale = scale_of(system.information());
  const Eigen::MatrixXd scaled = scale.asDiagonal() * system.information() * scale.asDiagonal();
  const Eigen::LDLT<Eigen::MatrixXd> S(scaled);
  constexpr double kSingular = 1e-13;
  if (S.info() != Eigen::Success || !(S.vectorD().minCoeff() > kSingular)) return out;
  const auto n = static_cast<Eigen::Index>(free.size());
  const Eigen::MatrixXd inverse = scale.asDiagonal() *
                                  S.solve(Eigen::MatrixXd::Identity(scaled.rows(), scaled.rows())) *
                                  scale.asDiagonal();
  const Eigen::MatrixXd white = sigma_px * sigma_px * inverse.topLeftCorner(n, n);
  Eigen::MatrixXd seen = Eigen::MatrixXd::Zero(n, n);
  for (const Eigen::VectorXd& pull : system.pulls()) {
    const Eigen::VectorXd step = inverse.topRows(n) * pull;
    seen += step * step.transpose();
  }
  const auto views = static_cast<double>(system.pulls().size());
  if (views > 1) seen *= views / (views - 1);
  out.correlation = white.ldlt().solve(seen).trace() / static_cast<double>(n);
  const double factor = std::max(1.0, out.correlation);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      out.covariance(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]) =
          factor * white(i, j);
  out.determined = true;
  return out;
}

}  // namespace fiducap
