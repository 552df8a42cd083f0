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

constexpr std::size_t kTerms = 7;
using Polynomial = std::array<double, kTerms>;

double evaluate(const Polynomial& polynomial, double s) {
  double value = 0;
  for (auto c = polynomial.rbegin(); c != polynomial.rend(); ++c) value = value * s + *c;
  return value;
}

Polynomial derivative(const Polynomial& polynomial) {
  Polynomial out{};
  for (std::size_t i = 1; i < kTerms; ++i) out[i - 1] = static_cast<double>(i) * polynomial[i];
  return out;
}

// Adds factor × a × b × s^shift. @pre its degree is below kTerms
void add_product(double factor, const Polynomial& a, const Polynomial& b, std::size_t shift,
                 Polynomial& to) {
  for (std::size_t i = 0; i < kTerms; ++i)
    for (std::size_t j = 0; i + j + shift < kTerms; ++j) to[i + j + shift] += factor * a[i] * b[j];
}

// Bernstein coefficients of the polynomial on [0, s]: the polynomial lies in their convex hull.
Polynomial bernstein(const Polynomial& polynomial, double s) {
  Polynomial b{};
  double power = 1;
  for (std::size_t i = 0; i < kTerms; ++i, power *= s) {
    double share = polynomial[i] * power;  // × C(j, i) / C(degree, i)
    for (std::size_t k = 0; k < i; ++k)
      share *= static_cast<double>(k + 1) / static_cast<double>(kTerms - 1 - k);
    for (std::size_t j = i; j < kTerms; ++j) {
      b[j] += share;
      share *= static_cast<double>(j + 1) / static_cast<double>(j + 1 - i);
    }
  }
  return b;
}

// Length of the leading part of [0, 1] on which the polynomial is surely positive, to 2^-depth.
double positive_part(const Polynomial& b, int depth) {
  if (*std::ranges::min_element(b) > 0) return 1;
  if (b[0] <= 0 || depth == 0) return 0;
  Polynomial left{};
  Polynomial right = b;
  for (std::size_t i = 0; i < kTerms; ++i) {  // de Casteljau at the middle
    left[i] = right[0];
    for (std::size_t j = 0; j + 1 < kTerms - i; ++j) right[j] = 0.5 * (right[j] + right[j + 1]);
  }
  const double in_left = positive_part(left, depth - 1);
  return in_left < 1 ? 0.5 * in_left : 0.5 + 0.5 * positive_part(right, depth - 1);
}

// Where the polynomial of radius² first reaches zero, or `limit` when it does not before.
double first_zero(const Polynomial& polynomial, double limit) {
  constexpr int kDepth = 44;  // 2^-44 of limit²
  return limit * std::sqrt(positive_part(bernstein(polynomial, limit * limit), kDepth));
}

}  // namespace

Lens::Lens(const CameraModel& camera)
    : kind_(camera.distortion), above_{1}, below_{1}, slope_{}, p1_(0), p2_(0) {
  FIDUCAP_ASSERT(camera.distortion != Distortion::kNone);
  const auto& k = camera.coefficients;
  if (kind_ == Distortion::kEquidistant) {
    above_ = {1, k[0], k[1], k[2], k[3]};
  } else {
    above_ = {1, k[0], k[1], k[4]};
    p1_ = k[2];
    p2_ = k[3];
  }
  if (kind_ == Distortion::kRational) below_ = {1, k[5], k[6], k[7]};
  // d(r a / b) / dr with s = r²: (a b + 2 s (a' b - a b')) / b²
  add_product(1, above_, below_, 0, slope_);
  add_product(2, derivative(above_), below_, 1, slope_);
  add_product(-2, above_, derivative(below_), 1, slope_);
}

double Lens::radius_of(const Eigen::Vector2d& ideal) const {
  return kind_ == Distortion::kEquidistant ? std::atan(ideal.norm()) : ideal.norm();
}

double Lens::raw_radius(double radius) const {
  const double s = radius * radius;
  return radius * evaluate(above_, s) / evaluate(below_, s);
}

bool Lens::grows_at(double radius) const {
  const double s = radius * radius;
  return evaluate(slope_, s) > 0 && evaluate(below_, s) > 0;
}

double Lens::fold(double limit) const {
  return std::min(first_zero(slope_, limit), first_zero(below_, limit));
}

bool Lens::folds_back_before(double radius) const {
  return !grows_at(radius) || fold(radius) < radius;
}

DistortedPoint Lens::distort(const Eigen::Vector2d& ideal) const {
  return kind_ == Distortion::kEquidistant ? distort_equidistant(ideal)
                                           : distort_radial_tangential(ideal);
}

DistortedPoint Lens::distort_radial_tangential(const Eigen::Vector2d& ideal) const {
  const double x = ideal.x();
  const double y = ideal.y();
  const double s = ideal.squaredNorm();
  const double below = evaluate(below_, s);
  const double scale = evaluate(above_, s) / below;
  const double scale_ds =
      (evaluate(derivative(above_), s) - scale * evaluate(derivative(below_), s)) / below;
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
  const double scale = raw_radius(angle) / r;
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
  double high = fold(limit);
  if (!(raw_radius(high) >= wanted)) return std::nullopt;
  double radius = std::min(wanted, high);
  // Monotone on [low, high]: Newton, bisection where it would leave the bracket.
  for (int i = 0; i < kMaxIterations; ++i) {
    const double s = radius * radius;
    const double below = evaluate(below_, s);
    const double error = raw_radius(radius) - wanted;
    (error > 0 ? high : low) = radius;
    double next = radius - error * below * below / evaluate(slope_, s);
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

FirstBend::FirstBend(const CameraModel& camera, const Eigen::Vector2d& ideal)
    : ideal_(ideal), along_(ideal.squaredNorm()), slope_(1) {
  const double square = along_;
  if (camera.distortion == Distortion::kRational) {
    const auto& k = camera.coefficients;
    const double below = 1 + square * (k[5] + square * (k[6] + square * k[7]));
    const double below_ds = k[5] + square * (2 * k[6] + square * 3 * k[7]);
    along_ /= below;
    slope_ = (1 - along_ * below_ds) / below;
  }
  // Nearer to the axis both models are equal up to rounding.
  if (camera.distortion != Distortion::kEquidistant || square < 1e-8) return;
  const double r = std::sqrt(square);
  const double angle = std::atan(r);
  along_ = angle * angle * angle / r;
  slope_ = (3 * angle * angle / (1 + square) - along_) / (2 * square);
}

Eigen::Matrix2d FirstBend::raw_from_ideal() const {
  return along_ * Eigen::Matrix2d::Identity() + 2 * slope_ * ideal_ * ideal_.transpose();
}

}  // namespace fiducap
