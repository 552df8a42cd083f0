#include "estimation/world/noise_watch.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "estimation/filter/chi_square.hpp"

namespace fiducap::world {

namespace {

const Eigen::Vector2d kDeclared(1.0, 0.0);
// 1-sigma of what the noises may be off by all that is known beforehand: the IMU ten times its
// variance, the stamps three milliseconds.
const Eigen::Vector2d kPriorSigma(10.0, 10e-6);
const Eigen::Vector2d kMost(2500.0, 400e-6);
// Of what was learned, per image: 400 images, 20 s at 20 Hz.
constexpr double kForget = 1.0 - 1.0 / 400;
constexpr double kSignificant_sigma = 3.5;  // 1 in 4000
// Worth telling with the pose, long before it is significant.
constexpr double kWorthTelling_sigma = 2.0;
constexpr double kMostUnstated = 25.0;
constexpr double kToldNoise = 2.0;
// Less is what errors of the filter itself may look like: without any jitter 0.7 ms were found.
constexpr double kToldJitter_s = 1e-3;
// Of the curvature: so that nothing is divided by zero.
const Eigen::Vector2d kTiny(1e-6, 1e4);
// One image counts for no more than this, in sigmas of what it can say: it may be a wrong one. Less
// so once the noise is known to be large.
constexpr double kMostOfOneImage_sigma = 5.0;
constexpr double kMostOnceApplied_sigma = 10.0;
// At least so many images can be taken back, at most twice as many.
constexpr int kTakenBack = 40;
// Variances change the curvature once they are as large, and have changed by this factor.
constexpr double kLargeChange = 1.5;
const Eigen::Vector2d kNoticeable(0.0, 0.25e-6);

}  // namespace

Eigen::Matrix2d NoiseWatch::curvature() const {
  Eigen::Matrix2d J = now_.information;
  J.diagonal() += kPriorSigma.cwiseAbs2().cwiseInverse();
  return J;
}

void NoiseWatch::lose_motion() {
  P_.setZero();
  P_.diagonal() << Eigen::Matrix<double, 9, 1>::Ones(), Eigen::Vector3d::Constant(0.04),
      Eigen::Vector3d::Constant(4e-4);
  D_.setZero();
}

void NoiseWatch::begin_with(const LearnedNoise& learned) { now_ = earlier_ = before_ = learned; }

void NoiseWatch::take_back() {
  now_ = earlier_ = before_;
  images_since_earlier_ = 0;
  suspected_ = outgrown_ = 1;
}

double NoiseWatch::unstated_factor() const {
  return std::max(outgrown_, std::min(suspected_ / now_.applied(kImu), kMostUnstated));
}

void NoiseWatch::unlearn() {
  now_ = earlier_ = before_ = LearnedNoise{};
  doubted_since_.reset();
  suspected_ = 1;
}

void NoiseWatch::take_back_doubted() {
  if (!doubted_since_) return;
  suspected_ = outgrown_ = 1;
  now_ = earlier_ = before_ = *doubted_since_;
  doubted_since_.reset();
}

double NoiseWatch::sigma_of(Noise noise) const {
  return std::sqrt(curvature().inverse()(noise, noise));
}

void NoiseWatch::follow(const MotionSinceImage& motion) {
  if (!motion.begun) return;
  for (BodyMatrix* const M : {&D_, &P_}) move_both_ways(motion.Phi, *M);
  D_ += motion.Q / now_.applied(kImu);
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
  // Squares of normal numbers, Σ ½ (z² − 1) λ: their third cumulant is Σ λ³.
  const Eigen::Vector2d third((AD * AD * AD).trace(), std::pow(information_on_time, 3));
  information(kImu, kStamps) = information(kStamps, kImu) =
      0.5 * Ao.dot(D_.topLeftCorner<6, 6>() * Ao);
  if (!derivative.allFinite() || !information.allFinite()) return;
  for (const Noise noise : {kImu, kStamps}) {
    const double sigmas =
        now_.applied(noise) > kDeclared(noise) ? kMostOnceApplied_sigma : kMostOfOneImage_sigma;
    const double most = sigmas * std::sqrt(std::max(0.0, information(noise, noise)));
    derivative(noise) = std::clamp(derivative(noise), -most, most);
  }
  now_.derivative = kForget * now_.derivative + derivative;
  now_.information = kForget * now_.information + information;
  now_.third = kForget * now_.third + third;
  apply_estimate();
  if (++images_since_earlier_ < kTakenBack) return;
  images_since_earlier_ = 0;
  before_ = std::exchange(earlier_, now_);
}

double NoiseWatch::score_of(Noise noise) const {
  const double information = now_.information(noise, noise) + kTiny(noise);
  return normal_score(now_.derivative(noise) / std::sqrt(information),
                      now_.third(noise) / std::pow(information, 1.5));
}

void NoiseWatch::apply_estimate() {
  const Eigen::Matrix2d J = curvature();
  const Eigen::Vector2d to_declared =
      kPriorSigma.cwiseAbs2().cwiseInverse().cwiseProduct(kDeclared - now_.applied);
  const Eigen::Matrix2d covariance = J.inverse();
  const Eigen::Vector2d estimate = now_.applied + covariance * (now_.derivative + to_declared);
  const Eigen::Vector2d before = now_.applied;
  for (const Noise noise : {kImu, kStamps}) {
    const bool was_beyond = before(noise) > kDeclared(noise);
    // A score test at the declared noise; once it is given up, the estimate alone decides.
    const double score = score_of(noise);
    const bool is_significant =
        estimate(noise) > kDeclared(noise) && (was_beyond || score > kSignificant_sigma);
    now_.applied(noise) =
        is_significant ? std::min(estimate(noise), kMost(noise)) : kDeclared(noise);
    if (noise == kImu)
      suspected_ = score > kWorthTelling_sigma ? estimate(noise) : kDeclared(noise);
  }
  outgrown_ = 1 + kForget * (outgrown_ - 1);
  outgrown_ = std::clamp(outgrown_ * now_.applied(kImu) / before(kImu), 1.0, kMostUnstated);
  now_.derivative -=
      now_.information * (now_.applied - before);  // they are those at what is applied
  weigh_anew();
}

/// A variance that grows is known less well by what was seen before.
void NoiseWatch::weigh_anew() {
  const Eigen::Array2d grown =
      (now_.applied + kNoticeable).array() / (now_.weighed_at + kNoticeable).array();
  if ((grown < kLargeChange && grown > 1 / kLargeChange).all()) return;
  const Eigen::Vector2d weight = grown.inverse().min(1.0).matrix();
  now_.derivative = weight.cwiseAbs2().cwiseProduct(now_.derivative).eval();
  now_.information = weight.asDiagonal() * now_.information * weight.asDiagonal();
  now_.third = weight.array().cube().matrix().cwiseProduct(now_.third).eval();
  now_.weighed_at = now_.applied;
}

void NoiseWatch::list(std::vector<FoundMismatch>& out) const {
  using Kind = FoundMismatch::Kind;
  const double density = std::sqrt(imu_variance());
  if (density > kToldNoise)
    out.push_back(
        {.kind = Kind::kImuNoise, .value = density, .sigma = sigma_of(kImu) / (2 * density)});
  if (jitter_s() > kToldJitter_s) out.push_back({.kind = Kind::kStampJitter, .value = jitter_s()});
}

void NoiseWatch::correct(const StackedUpdate::SharedScore& said, const Vector6d& on_time) {
  // The stamp's jitter is noise of the image: (R + τ² H o oᵀ Hᵀ)⁻¹ seen from the pose.
  const Vector6d Ao = said.by_known_tags * on_time;
  const double jitter = now_.applied(kStamps) / (1 + now_.applied(kStamps) * on_time.dot(Ao));
  const Matrix6d A = said.by_known_tags - jitter * Ao * Ao.transpose();
  const Matrix6d S = Matrix6d::Identity() + A * P_.topLeftCorner<6, 6>();
  const Eigen::Matrix<double, layout::kBodySize, 6> gain =
      P_.leftCols<6>().lazyProduct(Eigen::PartialPivLU<Matrix6d>(S).solve(A).eval());
  for (BodyMatrix* const M : {&P_, &D_}) {  // (1 − K H) M, of which only six columns are not 1
    const Eigen::Matrix<double, 6, layout::kBodySize> rows = M->topRows<6>();
    *M -= gain.lazyProduct(rows);
  }
  P_ = 0.5 * (P_ + P_.transpose()).eval();
  const Eigen::Matrix<double, layout::kBodySize, 6> columns = D_.leftCols<6>();
  D_ -= columns.lazyProduct(gain.transpose());
}

}  // namespace fiducap::world
