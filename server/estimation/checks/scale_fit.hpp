#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace fiducap {

/// By what a tag's configured size must be multiplied, as seen over some time: natural logarithm,
/// 1-sigma.
struct LogScale {
  double value{};
  double sigma{};
};

/// Linear least squares over the sightings of one tag: z = J x + noise, three rows per sighting.
///
/// The first unknown is κ = 1 / scale; it stands at how far the body moved in metres, z is where
/// the tag was seen in units of its configured size. So the noise of the images is all in z, and κ
/// is not pulled towards zero by it.
///
/// @tparam N  number of unknowns
template <int N>
class ScaleFit final {
 public:
  using Columns = Eigen::Matrix<double, 3, N>;
  using Vector = Eigen::Matrix<double, N, 1>;

  void restart() { *this = ScaleFit{}; }

  /// @param weight  inverse covariance of z
  void add(const Columns& J, const Eigen::Vector3d& z, const Eigen::Matrix3d& weight) {
    const Eigen::Matrix<double, N, 3> Jt = J.transpose();
    const Columns WJ = weight * J;
    A_ += Jt.lazyProduct(WJ);
    b_ += Jt.lazyProduct(weight * z);
    zWz_ += z.dot(weight * z);
    ++sightings_;
  }

  /// @param prior       information (1/σ²) about each unknown beforehand, around zero
  /// @param worst_cost  chi-square per degree of freedom above which no single scale explains what
  /// was seen; below, the
  ///                    sigma grows with it
  /// @return nullopt when too few sightings, no motion, or no single scale explains what was seen
  [[nodiscard]] std::optional<LogScale> solve(const Vector& prior, double worst_cost) const {
    constexpr int kFewestSightings = 8;
    constexpr double kLeastCertain = 0.3;
    constexpr double kSmallest =
        0.2;  // of κ: beyond five times the size nothing is linear any more
    if (sightings_ < kFewestSightings || 3 * sightings_ <= N) return std::nullopt;
    Eigen::Matrix<double, N, N> A = A_;
    A.diagonal() += prior;
    const Eigen::LDLT<Eigen::Matrix<double, N, N>> ldlt(A);
    const Vector x = ldlt.solve(b_);
    const double variance = ldlt.solve(Vector::Unit(0))(0);
    const double kappa = x(0);
    if (!(variance > 0) || !(kappa > kSmallest) || !(kappa < 1 / kSmallest)) return std::nullopt;
    const double cost = std::max(0.0, zWz_ - b_.dot(x)) / (3.0 * sightings_ - N);
    if (!(cost < worst_cost)) return std::nullopt;
    const LogScale out{-std::log(kappa), std::sqrt(variance * std::max(1.0, cost)) / kappa};
    return out.sigma < kLeastCertain ? std::optional(out) : std::nullopt;
  }

 private:
  Eigen::Matrix<double, N, N> A_{Eigen::Matrix<double, N, N>::Zero()};
  Vector b_{Vector::Zero()};
  double zWz_{0};
  int sightings_{0};
};

}  // namespace fiducap
