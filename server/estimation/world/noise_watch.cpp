#include "estimation/world/noise_watch.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace fiducap::world {

namespace {

const Eigen::Vector2d kDeclared(1.0, 0.0);
// 1-sigma of what the noises may be off by all that is known beforehand: the IMU ten times its
// variance, the stamps three milliseconds.
const Eigen::Vector2d kPriorSigma(10.0, 10e-6);
const Eigen::Vector2d kMost(2500.0, 400e-6);
// Of what was learned, per image: 400 images, 20 s at 20 Hz.
constexpr double kForget = 1.0 - 1.0 / 400;
constexpr double kSignificant_sigma = 4.0;
// Of the curvature: so that nothing is divided by zero.
const Eigen::Vector2d kTiny(1e-6, 1e4);
// One image counts for no more than this, in sigmas of what it can say: it may be a wrong one. Less
// so once the noise is known to be large.
constexpr double kMostOfOneImage_sigma = 5.0;
constexpr double kMostOnceApplied_sigma = 10.0;
// Variances change the curvature once they are as large, and have changed by this factor.
constexpr double kLargeChange = 1.5;
const Eigen::Vector2d kNoticeable(0.0, 0.25e-6);

}  // namespace

Eigen::Matrix2d NoiseWatch::curvature() const {
  Eigen::Matrix2d J = information_;
  J.diagonal() += kPriorSigma.cwiseAbs2().cwiseInverse();
  return J;
}

void NoiseWatch::lose_motion() {
  P_.setZero();
  P_.diagonal() << Eigen::Matrix<double, 9, 1>::Ones(), Eigen::Vector3d::Constant(0.04),
      Eigen::Vector3d::Constant(4e-4);
  D_.setZero();
}

double NoiseWatch::sigma_of(Noise noise) const {
  return std::sqrt(curvature().inverse()(noise, noise));
}

void NoiseWatch::follow(const MotionSinceImage& motion) {
  if (!motion.begun) return;
  const BodyMatrix moved = motion.Phi * D_;
  D_.noalias() = moved * motion.Phi.transpose();
  D_ += motion.Q / applied_(kImu);
  const BodyMatrix moved_P = motion.Phi * P_;
  P_.noalias() = moved_P * motion.Phi.transpose();
  P_ += motion.Q;
}

void NoiseWatch::learn(const StackedUpdate::SharedScore& said, const Vector6d& on_time) {
  const Matrix6d& A = said.information;
  const Vector6d& a = said.score;
  const Matrix6d AD = A * D_.topLeftCorner<6, 6>();
  const Vector6d Ao = A * on_time;
  const double information_on_time = on_time.dot(Ao);
  const double score_on_time = on_time.dot(a);
  Eigen::Vector2d derivative;
  derivative(kImu) = 0.5 * (a.dot(D_.topLeftCorner<6, 6>() * a) - AD.trace());
  derivative(kStamps) = 0.5 * (score_on_time * score_on_time - information_on_time);
  Eigen::Matrix2d information;
  information(kImu, kImu) = 0.5 * (AD * AD).trace();
  information(kStamps, kStamps) = 0.5 * information_on_time * information_on_time;
  information(kImu, kStamps) = information(kStamps, kImu) =
      0.5 * Ao.dot(D_.topLeftCorner<6, 6>() * Ao);
  if (!derivative.allFinite() || !information.allFinite()) return;
  for (const Noise noise : {kImu, kStamps}) {
    const double sigmas =
        applied_(noise) > kDeclared(noise) ? kMostOnceApplied_sigma : kMostOfOneImage_sigma;
    const double most = sigmas * std::sqrt(std::max(0.0, information(noise, noise)));
    derivative(noise) = std::clamp(derivative(noise), -most, most);
  }
  derivative_ = kForget * derivative_ + derivative;
  information_ = kForget * information_ + information;
  apply_estimate();
}

void NoiseWatch::apply_estimate() {
  const Eigen::Matrix2d J = curvature();
  const Eigen::Vector2d to_declared =
      kPriorSigma.cwiseAbs2().cwiseInverse().cwiseProduct(kDeclared - applied_);
  const Eigen::Matrix2d covariance = J.inverse();
  const Eigen::Vector2d estimate = applied_ + covariance * (derivative_ + to_declared);
  const Eigen::Vector2d before = applied_;
  for (const Noise noise : {kImu, kStamps}) {
    const bool was_beyond = before(noise) > kDeclared(noise);
    // A score test at the declared noise; once it is given up, the estimate alone decides.
    const double score = derivative_(noise) / std::sqrt(information_(noise, noise) + kTiny(noise));
    const bool is_significant =
        estimate(noise) > kDeclared(noise) && (was_beyond || score > kSignificant_sigma);
    applied_(noise) = is_significant ? std::min(estimate(noise), kMost(noise)) : kDeclared(noise);
  }
  derivative_ -= information_ * (applied_ - before);  // they are those at what is applied
  weigh_anew();
}

/// A variance that grows is known less well by what was seen before.
void NoiseWatch::weigh_anew() {
  const Eigen::Array2d grown =
      (applied_ + kNoticeable).array() / (weighed_at_ + kNoticeable).array();
  if ((grown < kLargeChange && grown > 1 / kLargeChange).all()) return;
  const Eigen::Vector2d weight = grown.inverse().min(1.0).matrix();
  derivative_ = weight.cwiseAbs2().cwiseProduct(derivative_).eval();
  information_ = weight.asDiagonal() * information_ * weight.asDiagonal();
  weighed_at_ = applied_;
}

void NoiseWatch::correct(const StackedUpdate::SharedScore& said, const Vector6d& on_time) {
  // The stamp's jitter is noise of the image: (R + τ² H o oᵀ Hᵀ)⁻¹ seen from the pose.
  const Vector6d Ao = said.by_known_tags * on_time;
  const double jitter = applied_(kStamps) / (1 + applied_(kStamps) * on_time.dot(Ao));
  const Matrix6d A = said.by_known_tags - jitter * Ao * Ao.transpose();
  const Matrix6d S = Matrix6d::Identity() + A * P_.topLeftCorner<6, 6>();
  const Eigen::Matrix<double, layout::kBodySize, 6> gain =
      P_.leftCols<6>() * Eigen::PartialPivLU<Matrix6d>(S).solve(A);
  BodyMatrix left = BodyMatrix::Identity();
  left.leftCols<6>() -= gain;
  const BodyMatrix half_P = left * P_;
  const BodyMatrix half_D = left * D_;
  P_ = 0.5 * (half_P + half_P.transpose());
  D_.noalias() = half_D * left.transpose();
}

}  // namespace fiducap::world
