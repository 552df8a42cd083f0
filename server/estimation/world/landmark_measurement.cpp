#include "estimation/world/landmark_measurement.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "base/assert.hpp"
#include "base/so3.hpp"

namespace fiducap::world {

namespace {

using Matrix23d = Eigen::Matrix<double, 2, 3>;

constexpr double kNearest_m = 0.1;
constexpr int kMostSteps = 8;
constexpr double kSettled = 1e-6;  // change of direction, and of inverse depth as a share of it

/// ∂ ideal pixel / ∂ point in camera axes
Matrix23d pinhole_jacobian(const CameraModel& model, const Eigen::Vector3d& p_V) {
  const double w = 1 / p_V.z();
  Matrix23d J;
  J << model.fu * w, 0, -model.fu * w * w * p_V.x(), 0, model.fv * w, -model.fv * w * w * p_V.y();
  return J;
}

/// Least squares in (x/z, y/z, 1/z) of the last view's axes.
struct InverseDepthFit {
  Eigen::Matrix3d information;
  Eigen::Vector3d gradient;
  bool in_front;
};

InverseDepthFit linearise(const CameraModel& model, std::span<const LandmarkView> views,
                          const Eigen::Vector3d& x) {
  InverseDepthFit fit{Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero(), true};
  const Pose& X_WA = views.back().X_WV;
  for (const LandmarkView& view : views) {
    const Pose X_VA = view.X_WV.inverse() * X_WA;
    const Eigen::Matrix3d R_VA = X_VA.rotation();
    const Eigen::Vector3d h = R_VA * Eigen::Vector3d(x.x(), x.y(), 1) + x.z() * X_VA.p;
    if (!(h.z() > 0)) {
      fit.in_front = false;
      return fit;
    }
    Eigen::Matrix3d dh;
    dh << R_VA.col(0), R_VA.col(1), X_VA.p;
    const Eigen::Matrix2d raw_from_ideal = view.ideal_from_raw.inverse();
    const Matrix23d J = raw_from_ideal * pinhole_jacobian(model, h) * dh;
    const Eigen::Vector2d e = raw_from_ideal * (view.px - model.pinhole(h));
    fit.information += J.transpose() * J;
    fit.gradient += J.transpose() * e;
  }
  return fit;
}

}  // namespace

std::optional<Triangulated> triangulate(const CameraModel& model,
                                        std::span<const LandmarkView> views, double noise_px) {
  const LandmarkView& last = views.back();
  // From infinity: an inverse depth of zero is as good a beginning as any, the problem is nearly
  // linear.
  Eigen::Vector3d x((last.px.x() - model.cu) / model.fu, (last.px.y() - model.cv) / model.fv, 0);
  for (int step = 0; step < kMostSteps; ++step) {
    const InverseDepthFit fit = linearise(model, views, x);
    if (!fit.in_front) return std::nullopt;
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(fit.information);
    const Eigen::Vector3d dx = ldlt.solve(fit.gradient);
    if (!dx.allFinite()) return std::nullopt;
    x += dx;
    if (!(dx.head<2>().norm() < kSettled &&
          std::abs(dx.z()) < kSettled + kSettled * std::abs(x.z())))
      continue;
    if (!(x.z() > 0) || 1 / x.z() < kNearest_m) return std::nullopt;
    const double sigma =
        noise_px * std::sqrt(std::max(0.0, ldlt.solve(Eigen::Vector3d::UnitZ()).z()));
    const Eigen::Vector3d p_V = Eigen::Vector3d(x.x(), x.y(), 1) / x.z();
    return Triangulated{last.X_WV * p_V, p_V.z(), sigma / x.z()};
  }
  return std::nullopt;
}

LandmarkMeasurement::LandmarkMeasurement(int slots)
    : y_(2 * kMostViews), H_(2 * kMostViews, 6 * slots), H_landmark_(2 * kMostViews, 3) {}

bool LandmarkMeasurement::build(const CameraModel& model, std::span<const LandmarkView> views,
                                const Eigen::Vector3d& p_W, const TrackNoise& noise) {
  const int n = static_cast<int>(views.size());
  FIDUCAP_ASSERT(n >= 3 && n <= kMostViews);
  H_.topRows(2 * n).setZero();
  for (int j = 0; j < n; ++j) {
    const LandmarkView& view = views[static_cast<std::size_t>(j)];
    const Eigen::Vector3d p_V = view.X_WV.inverse() * p_W;
    if (!(p_V.z() > kNearest_m)) return false;
    const Eigen::Matrix2d raw_from_ideal = view.ideal_from_raw.inverse();
    const Eigen::Vector2d e = raw_from_ideal * (view.px - model.pinhole(p_V));
    const Matrix23d G =
        raw_from_ideal * pinhole_jacobian(model, p_V) * view.X_WV.rotation().transpose();
    const Matrix23d G_turn = G * skew(p_W);
    for (int k = 0; k < 2; ++k) {
      const int row = k * n + j;
      y_(row) = e(k);
      H_landmark_.row(row) = G.row(k);
      H_.row(row).segment<3>(6 * view.slot) = -G.row(k);
      H_.row(row).segment<3>(6 * view.slot + 3) = G_turn.row(k);
    }
  }
  whiten(n, noise);
  turn_landmark_away(2 * n);
  rows_ = 2 * n - kLandmarkSize;
  return true;
}

void LandmarkMeasurement::whiten(int views, const TrackNoise& noise) {
  Eigen::Matrix<double, kMostViews, kMostViews> R;
  for (int a = 0; a < views; ++a) {
    for (int b = 0; b < views; ++b) {
      R(a, b) = (a == b ? noise.white_px * noise.white_px : 0.0) +
                noise.walk_px * noise.walk_px * std::min(a, b);
    }
  }
  // Cholesky and forward substitution in one, row by row.
  for (int a = 0; a < views; ++a) {
    for (int b = 0; b <= a; ++b) {
      double value = R(a, b);
      for (int k = 0; k < b; ++k) value -= R(a, k) * R(b, k);
      R(a, b) = b < a ? value / R(b, b) : std::sqrt(value);
    }
    for (int half = 0; half < 2; ++half) {
      const int row = half * views + a;
      for (int k = 0; k < a; ++k) {
        const int other = half * views + k;
        y_(row) -= R(a, k) * y_(other);
        H_landmark_.row(row) -= R(a, k) * H_landmark_.row(other);
        H_.row(row) -= R(a, k) * H_.row(other);
      }
      y_(row) /= R(a, a);
      H_landmark_.row(row) /= R(a, a);
      H_.row(row) /= R(a, a);
    }
  }
}

void LandmarkMeasurement::turn_landmark_away(int rows) {
  // Three Householder reflections make the landmark's Jacobian upper triangular.
  Eigen::Matrix<double, 2 * kMostViews, 1> axis;
  for (int c = 0; c < kLandmarkSize; ++c) {
    const int tail = rows - c;
    auto v = axis.head(tail);
    v = H_landmark_.col(c).segment(c, tail);
    const double norm = v.norm();
    v(0) += v(0) < 0 ? -norm : norm;
    const double scale = v.squaredNorm();
    if (!(scale > 0)) continue;
    const double factor = 2 / scale;
    for (int k = c; k < kLandmarkSize; ++k) {
      const double along = factor * v.dot(H_landmark_.col(k).segment(c, tail));
      H_landmark_.col(k).segment(c, tail) -= along * v;
    }
    y_.segment(c, tail) -= (factor * v.dot(y_.segment(c, tail))) * v;
    for (Eigen::Index k = 0; k < H_.cols(); ++k) {
      const double along = factor * v.dot(H_.col(k).segment(c, tail));
      if (along != 0) H_.col(k).segment(c, tail) -= along * v;
    }
  }
}

}  // namespace fiducap::world
