#include "capture/lens/lens.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "base/expected.hpp"

namespace fiducap {
namespace {

constexpr int kMaxIterations = 50;
// Of radius ~1. Convergence is quadratic: after a step this small only rounding errors remain.
constexpr double kConverged = 1e-12;

double evaluate(const std::array<double, 5>& polynomial, double s) {
  double value = 0;
  for (auto c = polynomial.rbegin(); c != polynomial.rend(); ++c) value = value * s + *c;
  return value;
}

// Bernstein coefficients of the polynomial on [0, s]: the polynomial lies in their convex hull.
std::array<double, 5> bernstein(const std::array<double, 5>& polynomial, double s) {
  constexpr double kBinomial[5][5] = {
      {1, 0, 0, 0, 0}, {1, 1, 0, 0, 0}, {1, 2, 1, 0, 0}, {1, 3, 3, 1, 0}, {1, 4, 6, 4, 1}};
  std::array<double, 5> power{};
  double s_i = 1;
  for (std::size_t i = 0; i < 5; ++i, s_i *= s) power[i] = polynomial[i] * s_i;
  std::array<double, 5> b{};
  for (std::size_t j = 0; j < 5; ++j)
    for (std::size_t i = 0; i <= j; ++i) b[j] += kBinomial[j][i] / kBinomial[4][i] * power[i];
  return b;
}

// Length of the leading part of [0, 1] on which the polynomial is surely positive, to 2^-depth.
double positive_part(const std::array<double, 5>& b, int depth) {
  if (*std::ranges::min_element(b) > 0) return 1;
  if (b[0] <= 0 || depth == 0) return 0;
  std::array<double, 5> left{};
  std::array<double, 5> right = b;
  for (std::size_t i = 0; i < 5; ++i) {  // de Casteljau at the middle
    left[i] = right[0];
    for (std::size_t j = 0; j + 1 < 5 - i; ++j) right[j] = 0.5 * (right[j] + right[j + 1]);
  }
  const double in_left = positive_part(left, depth - 1);
  return in_left < 1 ? 0.5 * in_left : 0.5 + 0.5 * positive_part(right, depth - 1);
}

// Where the slope first reaches zero, or `limit` when it does not before.
double fold_of(const std::array<double, 5>& slope, double limit) {
  constexpr int kDepth = 44;  // 2^-44 of limit²
  return limit * std::sqrt(positive_part(bernstein(slope, limit * limit), kDepth));
}

}  // namespace

Lens::Lens(const CameraModel& camera)
    : kind_(camera.distortion), scale_{1, 0, 0, 0, 0}, slope_{1, 0, 0, 0, 0}, p1_(0), p2_(0) {
  FIDUCAP_ASSERT(camera.distortion != Distortion::kNone);
  const auto& k = camera.coefficients;
  if (kind_ == Distortion::kEquidistant) {
    scale_ = {1, k[0], k[1], k[2], k[3]};
  } else {
    scale_ = {1, k[0], k[1], k[4], 0};
    p1_ = k[2];
    p2_ = k[3];
  }
  for (std::size_t i = 0; i < 5; ++i) slope_[i] = static_cast<double>(2 * i + 1) * scale_[i];
}

double Lens::radius_of(const Eigen::Vector2d& ideal) const {
  return kind_ == Distortion::kEquidistant ? std::atan(ideal.norm()) : ideal.norm();
}

bool Lens::folds_back_before(double radius) const {
  return !(evaluate(slope_, radius * radius) > 0) || fold_of(slope_, radius) < radius;
}

DistortedPoint Lens::distort(const Eigen::Vector2d& ideal) const {
  return kind_ == Distortion::kEquidistant ? distort_equidistant(ideal)
                                           : distort_radial_tangential(ideal);
}

DistortedPoint Lens::distort_radial_tangential(const Eigen::Vector2d& ideal) const {
  const double x = ideal.x();
  const double y = ideal.y();
  const double s = ideal.squaredNorm();
  const double scale = evaluate(scale_, s);
  const double scale_ds = scale_[1] + s * (2 * scale_[2] + s * 3 * scale_[3]);
  DistortedPoint raw;
  raw.point = {x * scale + 2 * p1_ * x * y + p2_ * (s + 2 * x * x),
               y * scale + p1_ * (s + 2 * y * y) + 2 * p2_ * x * y};
  const double mixed = 2 * (x * y * scale_ds + p1_ * x + p2_ * y);
  raw.raw_from_ideal << scale + 2 * x * x * scale_ds + 2 * p1_ * y + 6 * p2_ * x, mixed,  //
      mixed, scale + 2 * y * y * scale_ds + 6 * p1_ * y + 2 * p2_ * x;
  return raw;
}

DistortedPoint Lens::distort_equidistant(const Eigen::Vector2d& ideal) const {
  const double r = ideal.norm();
  // Nearer to the axis the differences below are rounding errors, with factors < 1e-12.
  if (r < 1e-6) return {ideal, Eigen::Matrix2d::Identity()};
  const double angle = std::atan(r);
  const double scale = angle * evaluate(scale_, angle * angle) / r;
  const double raw_dr = evaluate(slope_, angle * angle) / (1 + r * r);
  const Eigen::Vector2d outwards = ideal / r;
  DistortedPoint raw;
  raw.point = scale * ideal;
  raw.raw_from_ideal =
      scale * Eigen::Matrix2d::Identity() + (raw_dr - scale) * outwards * outwards.transpose();
  return raw;
}

std::optional<Eigen::Vector2d> Lens::undistort_radius(const Eigen::Vector2d& raw,
                                                      double limit) const {
  const double wanted = raw.norm();
  if (wanted == 0) return raw;
  double low = 0;
  double high = fold_of(slope_, limit);
  if (!(high * evaluate(scale_, high * high) >= wanted)) return std::nullopt;
  double radius = std::min(wanted, high);
  // Monotone on [low, high]: Newton, bisection where it would leave the bracket.
  for (int i = 0; i < kMaxIterations; ++i) {
    const double error = radius * evaluate(scale_, radius * radius) - wanted;
    (error > 0 ? high : low) = radius;
    double next = radius - error / evaluate(slope_, radius * radius);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const bool converged = std::abs(next - radius) <= kConverged * (1 + radius);
    radius = next;
    if (converged) break;
  }
  const double ideal_radius = kind_ == Distortion::kEquidistant ? std::tan(radius) : radius;
  return raw * (ideal_radius / wanted);
}

std::optional<Eigen::Vector2d> Lens::undistort(const Eigen::Vector2d& raw,
                                               double max_angle_rad) const {
  const double limit = kind_ == Distortion::kEquidistant ? max_angle_rad : std::tan(max_angle_rad);
  std::optional<Eigen::Vector2d> ideal = undistort_radius(raw, limit);
  if (!ideal || (p1_ == 0 && p2_ == 0)) return ideal;
  for (int i = 0; i < kMaxIterations; ++i) {
    const DistortedPoint there = distort(*ideal);
    if (!(there.raw_from_ideal.determinant() > 0)) return std::nullopt;
    const Eigen::Vector2d step = there.raw_from_ideal.inverse() * (raw - there.point);
    *ideal += step;
    if (!ideal->allFinite()) return std::nullopt;
    if (step.norm() > kConverged * (1 + ideal->norm())) continue;
    if (radius_of(*ideal) > limit || folds_back_before(radius_of(*ideal))) return std::nullopt;
    return ideal;
  }
  return std::nullopt;
}

FirstBend::FirstBend(Distortion distortion, const Eigen::Vector2d& ideal)
    : ideal_(ideal), along_(ideal.squaredNorm()), slope_(1) {
  const double square = along_;
  // Nearer to the axis both models are equal up to rounding.
  if (distortion != Distortion::kEquidistant || square < 1e-8) return;
  const double r = std::sqrt(square);
  const double angle = std::atan(r);
  along_ = angle * angle * angle / r;
  slope_ = (3 * angle * angle / (1 + square) - along_) / (2 * square);
}

Eigen::Matrix2d FirstBend::raw_from_ideal() const {
  return along_ * Eigen::Matrix2d::Identity() + 2 * slope_ * ideal_ * ideal_.transpose();
}

}  // namespace fiducap
