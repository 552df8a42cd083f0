#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "base/time.hpp"
#include "estimation/imu/imu_buffer.hpp"

namespace fiducap {

/// Natural logarithm of the factor between a tag's true and configured size.
struct LogScale {
  double value{};
  double sigma{};
};

/// Linear least squares over the sightings of one tag: z = J x + noise, three rows per sighting.
///
/// The first unknown is κ = 1 / scale, with the body's motion in metres as column; z is the tag's
/// position in units of its configured size. All image noise is in z, so κ is not biased by it.
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

  /// @param prior       prior information (1/σ²) of each unknown, around zero
  /// @param worst_cost  largest chi-square per degree of freedom; the sigma grows with it
  /// @return nullopt: too few sightings, no motion, or a bad fit
  [[nodiscard]] std::optional<LogScale> solve(const Vector& prior, double worst_cost) const {
    constexpr int kFewestSightings = 8;
    constexpr double kLeastCertain = 0.3;
    constexpr double kSmallest = 0.2;  // κ is not linear beyond a factor of five
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

/// Weighted median of independent estimates of one scale, with its sigma by their scatter. Robust
/// to a few wrong ones (a moved tag, a saturated sensor). Uses the newest 32.
class ScaleScore final {
 public:
  struct Rules {
    std::size_t fewest_looks{4};
    double systematic{0.03};  ///< Systematic error of a single estimate, 1-sigma.
  };
  explicit ScaleScore(const Rules& rules) : rules_(rules) {}

  void add(const LogScale& look);
  [[nodiscard]] std::size_t looks() const { return count_; }
  /// nullopt with fewer than `fewest_looks`.
  [[nodiscard]] std::optional<LogScale> result() const {
    return count_ < rules_.fewest_looks ? std::nullopt : guess();
  }
  /// The same with any number; nullopt: none.
  [[nodiscard]] std::optional<LogScale> guess() const;
  /// Share of the weight on the same side of zero as `value`, by 2 % at least.
  [[nodiscard]] double agreement(double value) const;

 private:
  static constexpr std::size_t kMost = 32;

  [[nodiscard]] double weight_of(const LogScale& look) const {
    return 1 / (look.sigma * look.sigma + rules_.systematic * rules_.systematic);
  }

  Rules rules_;
  std::array<LogScale, kMost> looks_{};
  std::size_t count_{0};
  std::size_t next_{0};
};

/// Motion of a body by its IMU alone since a restart, up to constant velocity, force and bias.
/// Independent of positions by cameras.
class MotionWindow final {
 public:
  explicit MotionWindow(const ImuNoise& noise);

  /// @return false: not newer than the previous one, ignored
  bool push(const ImuSample& imu) { return imu_.push(imu); }
  /// @param q_WB  attitude now; a tilt error is covered by the constant force
  /// @param gravity_W  e.g. (0, 0, -9.81)
  void restart(Instant at, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& bias_w,
               const Eigen::Vector3d& gravity_W);
  /// @return false: samples are missing or saturated
  bool move_to(Instant at);

  /// Drops old samples.
  void keep_newest() { imu_.keep_newest_pair(); }

  [[nodiscard]] double seconds() const { return to_seconds(time_ - begin_); }
  [[nodiscard]] const Eigen::Quaterniond& q_WB() const { return q_WB_; }
  /// m and m/s, W axes, from zero.
  [[nodiscard]] const Eigen::Vector3d& way() const { return way_; }
  [[nodiscard]] const Eigen::Vector3d& speed() const { return speed_; }
  [[nodiscard]] const Eigen::Vector3d& rate_B() const { return rate_B_; }
  /// ∂ way / ∂ constant force in B axes
  [[nodiscard]] const Eigen::Matrix3d& way_by_bias() const { return way_by_bias_; }

 private:
  ImuNoise noise_;
  ImuBuffer imu_;
  Instant begin_{};
  Instant time_{};
  Eigen::Quaterniond q_WB_{Eigen::Quaterniond::Identity()};
  Eigen::Vector3d bias_w_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gravity_W_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d way_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d speed_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d rate_B_{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d way_by_bias_{Eigen::Matrix3d::Zero()};
  Eigen::Matrix3d speed_by_bias_{Eigen::Matrix3d::Zero()};
  bool believable_{true};
};

}  // namespace fiducap
