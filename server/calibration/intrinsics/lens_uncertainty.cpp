#include "calibration/intrinsics/lens_uncertainty.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/initial_state.hpp"
#include "calibration/intrinsics/lens_fit.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {
namespace {

using Matrix2Xd = Eigen::Matrix<double, 2, Eigen::Dynamic>;

/// Free shape of a target, relative to half of its longer side, L. Coordinates ξ, η from its middle
/// are ±1 at the ends of the longer side: out of plane by L (a ξ² + b ξη + c η²); x longer and y
/// shorter by d / 2 each; angle of the sides e.
constexpr Eigen::Index kShapeNumbers = 5;

/// Scales the diagonal to 1: focal lengths and k4 differ by 1e8 in size.
Eigen::VectorXd scale_of(const Eigen::MatrixXd& S) {
  return S.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
}

/// Half of the longer side of a target, and its middle.
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

/// Contribution of one group in one view.
struct GroupTerms {
  Matrix6d H_pose{Matrix6d::Zero()};
  Vector6d g_pose{Vector6d::Zero()};
  Eigen::MatrixXd H_cross;
};

/// Normal equations of an adjusted state, poses of views marginalised (Schur complement): the
/// free lens parameters first, then targets that do not define their group, then the shape of
/// one.
class ReducedSystem final {
 public:
  /// @param shaped  the target with a free shape; -1: none
  ReducedSystem(const CalibrationData& data, const CalibrationState& state,
                const std::vector<int>& free, int shaped = -1)
      : data_(data), state_(state), free_(free), shaped_(shaped), column_(data.targets.size(), -1) {
    size_ = static_cast<Eigen::Index>(free.size());
    const std::vector<int> sightings = count_sightings(data);
    for (std::size_t t = 0; t < data.targets.size(); ++t)
      if (!state.defines_group(t) && sightings[t] > 0) {
        column_[t] = size_;
        size_ += 6;
      }
    if (shaped_ >= 0) {
      half_side_ = half_side(data.targets[to_index(shaped_)], middle_);
      size_ += kShapeNumbers;
    }
    S_ = Eigen::MatrixXd::Zero(size_, size_);
    for (std::size_t v = 0; v < data.views.size(); ++v) add_view(v);
    if (state.coefficient_sigma > 0) add_prior();
  }

  /// Per view: the gradient of its squared residuals / 2, poses marginalised.
  [[nodiscard]] const std::vector<Eigen::VectorXd>& gradients() const { return gradients_; }
  /// Sum of squared residuals, and degrees of freedom.
  [[nodiscard]] double squares() const { return squares_; }
  [[nodiscard]] double freedom() const { return freedom_ - static_cast<double>(size_); }
  /// Inverse of the information. @return false when singular
  [[nodiscard]] bool invert(Eigen::MatrixXd& inverse) const {
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
  /// Condition of the information, its diagonal scaled to 1; infinite when singular.
  [[nodiscard]] double condition() const {
    const Eigen::VectorXd scale = scale_of(S_);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
        scale.asDiagonal() * S_ * scale.asDiagonal(), Eigen::EigenvaluesOnly);
    if (solver.info() != Eigen::Success || !(solver.eigenvalues()(0) > 0))
      return std::numeric_limits<double>::infinity();
    return solver.eigenvalues().tail<1>()(0) / solver.eigenvalues()(0);
  }

 private:
  void add_prior() {
    const double variance = squares_ / std::max(1.0, freedom());
    const double weight = variance / (state_.coefficient_sigma * state_.coefficient_sigma);
    for (std::size_t i = 0; i < free_.size(); ++i)
      if (const auto k = static_cast<Eigen::Index>(i); free_[i] >= 4) S_(k, k) += weight;
  }

  void add_view(std::size_t v) {
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size_);
    std::map<int, GroupTerms> groups;
    for (const TargetSighting& sighting : data_.views[v].sightings) {
      const int group = state_.group(sighting);
      GroupTerms& terms = groups[group];
      if (terms.H_cross.size() == 0) terms.H_cross = Eigen::MatrixXd::Zero(size_, 6);
      for (const SeenPoint& seen : sighting.points)
        add_point(seen, to_index(sighting.target), state_.X_VG[v].at(group), terms, gradient);
    }
    for (const auto& [group, terms] : groups) {
      const Eigen::LDLT<Matrix6d> H(terms.H_pose);
      S_.noalias() -= terms.H_cross * H.solve(terms.H_cross.transpose());
      gradient.noalias() -= terms.H_cross * H.solve(terms.g_pose);
      freedom_ -= 6;
    }
    if (!groups.empty()) gradients_.push_back(std::move(gradient));
  }

  void add_point(const SeenPoint& seen, std::size_t target, const Pose& X_VG, GroupTerms& terms,
                 Eigen::VectorXd& gradient) {
    const Eigen::Vector3d p_T = data_.targets[target].points[to_index(seen.point)];
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
    terms.H_pose += J_pose.transpose() * J_pose;
    terms.g_pose += J_pose.transpose() * y;
    terms.H_cross.topRows(n) += J_lens.transpose() * J_pose;
    S_.topLeftCorner(n, n) += J_lens.transpose() * J_lens;
    gradient.head(n) += J_lens.transpose() * y;
    const Eigen::Matrix<double, 2, 3> to_group = at.d_point * X_VG.rotation();
    if (column_[target] >= 0) {
      Eigen::Matrix<double, 2, 6> J_target;
      J_target << to_group, -to_group * skew(turned_GT);
      add_block(column_[target], J_target, J_lens, J_pose, y, terms, gradient);
    }
    if (static_cast<int>(target) == shaped_)
      add_block(size_ - kShapeNumbers, to_group * state_.X_GT[target].rotation() * shape_at(p_T),
                J_lens, J_pose, y, terms, gradient);
  }

  /// Adds unknowns with the derivative `J` of a point's pixel.
  void add_block(Eigen::Index column, const Matrix2Xd& J, const Matrix2Xd& J_lens,
                 const Eigen::Matrix<double, 2, 6>& J_pose, const Eigen::Vector2d& y,
                 GroupTerms& terms, Eigen::VectorXd& gradient) {
    const Eigen::Index n = J_lens.cols();
    const Eigen::Index m = J.cols();
    terms.H_cross.middleRows(column, m) += J.transpose() * J_pose;
    S_.block(column, column, m, m) += J.transpose() * J;
    S_.block(0, column, n, m) += J_lens.transpose() * J;
    S_.block(column, 0, m, n) += J.transpose() * J_lens;
    gradient.segment(column, m) += J.transpose() * y;
  }

  [[nodiscard]] Eigen::Matrix<double, 3, kShapeNumbers> shape_at(const Eigen::Vector3d& p_T) const {
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

  const CalibrationData& data_;
  const CalibrationState& state_;
  const std::vector<int>& free_;
  int shaped_;
  Eigen::Vector3d middle_{Eigen::Vector3d::Zero()};
  double half_side_{1};
  std::vector<Eigen::Index> column_;
  Eigen::Index size_{0};
  Eigen::MatrixXd S_;
  std::vector<Eigen::VectorXd> gradients_;
  double squares_{0};
  double freedom_{0};  ///< Without lens, targets and shape.
};

/// Scatter of the images' steps of the first `n` unknowns.
Eigen::MatrixXd scatter_of(const ReducedSystem& system, const Eigen::MatrixXd& inverse,
                           Eigen::Index n) {
  Eigen::MatrixXd seen = Eigen::MatrixXd::Zero(n, n);
  for (const Eigen::VectorXd& gradient : system.gradients()) {
    const Eigen::VectorXd step = inverse.topRows(n) * gradient;
    seen += step * step.transpose();
  }
  const auto views = static_cast<double>(system.gradients().size());
  if (views > 1) seen *= views / (views - 1);
  return seen;
}

constexpr std::size_t kPointsOfBoard = 6;

/// The board with the most observed points; -1: only tags.
int board_of(const CalibrationData& data) {
  std::vector<std::size_t> seen(data.targets.size(), 0);
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& s : view.sightings) seen[to_index(s.target)] += s.points.size();
  int best = -1;
  for (std::size_t t = 0; t < seen.size(); ++t) {
    if (data.targets[t].points.size() < kPointsOfBoard || seen[t] == 0) continue;
    if (best < 0 || seen[t] > seen[to_index(best)]) best = static_cast<int>(t);
  }
  return best;
}

/// Half of the largest bend over directions in the plane, of a ξ² + b ξη + c η².
double largest_bend(const Eigen::Vector3d& abc) {
  const double mean = (abc(0) + abc(2)) / 2;
  const double spread = std::hypot((abc(0) - abc(2)) / 2, abc(1) / 2);
  return std::max(std::abs(mean + spread), std::abs(mean - spread)) / 2;
}

constexpr std::size_t kMinPartViews = 5;

/// A part of the images with their poses.
template <typename Wanted>
LensFit part_of(const LensFit& fit, const Wanted& wanted) {
  LensFit part = fit;
  part.data.views.clear();
  part.state.X_VG.clear();
  std::size_t used = 0;
  for (std::size_t v = 0; v < fit.data.views.size(); ++v) {
    if (fit.data.views[v].sightings.empty() || !wanted(used++)) continue;
    part.data.views.push_back(fit.data.views[v]);
    part.state.X_VG.push_back(fit.state.X_VG[v]);
  }
  split_groups(part.data, part.state);
  return part;
}

double rms_of(const LensFit& fit) { return rms_per_coordinate(residuals(fit.data, fit.state)); }

/// Sums of squared residuals of the images of `others`, with the lens of `fitted` and with their
/// own.
struct Validation {
  double squares{};
  double own{};
};

std::optional<Validation> validate_with(const LensFit& fitted, const LensFit& others) {
  LensFit lens = fitted;
  if (!adjust(lens.data, {lens.free}, lens.state)) return std::nullopt;
  LensFit tested = others;
  if (!adjust(tested.data, {{}}, tested.state)) return std::nullopt;
  const auto points = static_cast<double>(count_points(tested.data));
  Validation out;
  out.own = points * std::pow(rms_of(tested), 2);
  tested.state.camera = lens.state.camera;
  if (!adjust(tested.data, {{}}, tested.state)) return std::nullopt;
  out.squares = points * std::pow(rms_of(tested), 2);
  return out;
}

/// Focal length and its sigma, px.
std::optional<std::pair<double, double>> focal_of(LensFit part) {
  if (part.data.views.size() < kMinPartViews) return std::nullopt;
  if (!adjust(part.data, {part.free}, part.state)) return std::nullopt;
  const auto uncertainty = uncertainty_of(part.data, part.state, part.free, part.sigma_px);
  if (!uncertainty.determined) return std::nullopt;
  return std::pair{part.state.camera.fu, std::sqrt(uncertainty.covariance(0, 0))};
}

}  // namespace

LensUncertainty uncertainty_of(const CalibrationData& data, const CalibrationState& state,
                               const std::vector<int>& free, double sigma_px) {
  LensUncertainty out;
  const ReducedSystem system(data, state, free);
  Eigen::MatrixXd inverse;
  if (!system.invert(inverse)) return out;
  const auto n = static_cast<Eigen::Index>(free.size());
  const Eigen::MatrixXd white = sigma_px * sigma_px * inverse.topLeftCorner(n, n);
  const Eigen::MatrixXd seen = scatter_of(system, inverse, n);
  out.correlation = white.ldlt().solve(seen).trace() / static_cast<double>(n);
  const double factor = std::max(1.0, out.correlation);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      out.covariance(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]) =
          factor * white(i, j);
  out.focal_scatter = std::sqrt(std::max(seen(0, 0) / white(0, 0), seen(1, 1) / white(1, 1)));
  out.condition = system.condition();
  out.determined = true;
  return out;
}

TargetShape estimate_target_shape(const CalibrationData& data, const CalibrationState& state,
                                  const std::vector<int>& free) {
  TargetShape out;
  const int board = board_of(data);
  if (board < 0) return out;
  const CalibrationTarget& target = data.targets[to_index(board)];
  Eigen::Vector3d middle;
  out.name = target.name;
  out.size_m = 2 * half_side(target, middle);
  const ReducedSystem system(data, state, free, board);
  Eigen::MatrixXd inverse;
  if (!system.invert(inverse) || system.gradients().size() < 2) return out;
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(inverse.rows());
  for (const Eigen::VectorXd& of_view : system.gradients()) gradient += of_view;
  const Eigen::VectorXd step = inverse * gradient;
  // Noise with the free shape: otherwise it would include the effect of the shape.
  const double variance =
      std::max(0.0, system.squares() - gradient.dot(step)) / std::max(1.0, system.freedom());
  const Eigen::Matrix<double, kShapeNumbers, 1> shape = step.tail<kShapeNumbers>();
  const Eigen::Matrix<double, kShapeNumbers, 1> sigma =
      (variance * inverse.diagonal().tail<kShapeNumbers>()).cwiseSqrt();
  out.bend = largest_bend(shape.head<3>());
  out.bend_sigma = sigma.head<3>().norm() / 2;
  out.stretch = shape(3);
  out.stretch_sigma = sigma(3);
  out.known = true;
  return out;
}

double HeldOut::focal_step_sigma() const {
  const double sigma = std::hypot(first_sigma, second_sigma);
  return sigma > 0 ? std::abs(second_focal - first_focal) / sigma : 0;
}

HeldOut hold_out(const LensFit& fit) {
  HeldOut out;
  const LensFit even = part_of(fit, [](std::size_t i) { return i % 2 == 0; });
  const LensFit odd = part_of(fit, [](std::size_t i) { return i % 2 == 1; });
  const std::size_t used = even.data.views.size() + odd.data.views.size();
  if (used < 2 * kMinPartViews) return out;
  const auto forth = validate_with(even, odd);
  const auto back = validate_with(odd, even);
  if (!forth || !back) return out;
  out.tried = true;
  const double own = forth->own + back->own;
  out.ratio = own > 0 ? std::sqrt((forth->squares + back->squares) / own) : 1;
  const auto first = focal_of(part_of(fit, [&](std::size_t i) { return 2 * i < used; }));
  const auto second = focal_of(part_of(fit, [&](std::size_t i) { return 2 * i >= used; }));
  if (!first || !second) return out;
  std::tie(out.first_focal, out.first_sigma) = *first;
  std::tie(out.second_focal, out.second_sigma) = *second;
  return out;
}

}  // namespace fiducap
