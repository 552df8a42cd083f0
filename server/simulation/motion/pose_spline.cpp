#include "simulation/motion/pose_spline.hpp"

#include <algorithm>
#include <cmath>

#include "base/assert.hpp"

namespace fiducap::simulation {

namespace {

using Weights = Eigen::Matrix<double, PoseSpline::kOrder, 1>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

// Uniform quintic B-spline: weight i is Σ kBasis(i, j) u^j / 120.
const Eigen::Matrix<double, 6, 6>& basis() {
  static const Eigen::Matrix<double, 6, 6> matrix = [] {
    Eigen::Matrix<double, 6, 6> m;
    m << 1, -5, 10, -10, 5, -1,    //
        26, -50, 20, 20, -20, 5,   //
        66, 0, -60, 0, 30, -10,    //
        26, 50, 20, -20, -20, 10,  //
        1, 5, 10, 10, 5, -5,       //
        0, 0, 0, 0, 0, 1;
    return Eigen::Matrix<double, 6, 6>(m / 120.0);
  }();
  return matrix;
}

Eigen::Quaterniond quaternion_of(const Vector7d& x) { return {x(3), x(4), x(5), x(6)}; }

}  // namespace

Weights PoseSpline::weights(double u, int derivative) {
  Weights powers = Weights::Zero();
  double power = 1.0;
  for (int j = derivative; j < kOrder; ++j) {
    double factor = 1.0;
    for (int d = 0; d < derivative; ++d) factor *= j - d;
    powers(j) = factor * power;
    power *= u;
  }
  return basis() * powers;
}

PoseSpline::PoseSpline(const std::vector<Pose>& control, double spacing, bool closed)
    : control_(7, static_cast<Eigen::Index>(control.size())), spacing_(spacing), closed_(closed) {
  FIDUCAP_ASSERT(control.size() >= kOrder && spacing > 0);
  const Eigen::Index n = control_.cols();
  for (Eigen::Index i = 0; i < n; ++i) {
    const Pose& X = control[static_cast<std::size_t>(i)];
    Eigen::Vector4d q(X.q.w(), X.q.x(), X.q.y(), X.q.z());
    if (i > 0 && q.dot(control_.col(i - 1).tail<4>()) < 0) q = -q;
    control_.col(i) << X.p, q;
  }
  pieces_ = closed ? n : n - kOrder + 1;
  if (closed && control_.col(n - 1).tail<4>().dot(control_.col(0).tail<4>()) < 0) wrap_sign_ = -1.0;
}

PoseSpline::PoseSpline(Control control, double spacing)
    : control_(std::move(control)),
      spacing_(spacing),
      pieces_(control_.cols() - kOrder + 1),
      closed_(false) {
  FIDUCAP_ASSERT(pieces_ > 0 && spacing > 0);
}

PoseSpline::Point PoseSpline::at(double s) const {
  const auto pieces = static_cast<double>(pieces_);
  double x = s / spacing_;
  x = closed_ ? x - pieces * std::floor(x / pieces) : std::clamp(x, 0.0, pieces);
  const auto piece = std::min(static_cast<Eigen::Index>(x), pieces_ - 1);
  const double u = x - static_cast<double>(piece);
  const Weights w0 = weights(u, 0);
  const Weights w1 = weights(u, 1) / spacing_;
  const Weights w2 = weights(u, 2) / (spacing_ * spacing_);
  Vector7d value = Vector7d::Zero();
  Vector7d first = Vector7d::Zero();
  Point point;
  point.acceleration.setZero();
  for (Eigen::Index i = 0; i < kOrder; ++i) {
    const Eigen::Index n = control_.cols();
    Vector7d c = control_.col((piece + i) % n);
    if (piece + i >= n) c.tail<4>() *= wrap_sign_;
    value += w0(i) * c;
    first += w1(i) * c;
    point.acceleration += w2(i) * c.head<3>();
  }
  // ω = 2 vec(q* q̇); for an unnormalised b = |b| q the change of |b| falls out: ω = 2 vec(b* ḃ) /
  // |b|².
  const Eigen::Quaterniond b = quaternion_of(value);
  point.rate = 2.0 * (b.conjugate() * quaternion_of(first)).vec() / b.squaredNorm();
  point.X = {b.normalized(), value.head<3>()};
  point.velocity = first.head<3>();
  return point;
}

}  // namespace fiducap::simulation
