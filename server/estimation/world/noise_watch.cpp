#include "estimation/world/noise_watch.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimation/filter/chi_square.hpp"

namespace fiducap::world {

namespace {
const Eigen::Vector2d kDeclared(1.0, 0.0);
// Prior 1-sigma: ten times the IMU's variance, three milliseconds for stamps.
const Eigen::Vector2d kPriorSigma(10.0, 10e-6);
const Eigen::Vector2d kMost(2500.0, 400e-6);
// Fading per image: 400 images, 20 s at 20 Hz.
constexpr double kForget = 1.0 - 1.0 / 400;
constexpr double kSignificant_sigma = 3.5;  // 1 in 4000
// Score of a likely variance, which inflates published covariances.
constexpr double kLikelyNoise_sigma = 2.0;
constexpr double kMostInflation = 25.0;
constexpr double kReportedNoise = 2.0;
// Errors of the filter itself resemble jitter up to 0.7 ms.
constexpr double kReportedJitter_s = 1e-3;
// Added to the curvature to avoid division by zero.
const Eigen::Vector2d kTiny(1e-6, 1e4);
// Bound of one image's influence, in its sigmas; larger once a large noise is applied.
constexpr double kMostOfOneImage_sigma = 5.0;
constexpr double kMostOnceApplied_sigma = 10.0;
// Change of a variance, and its smallest size, above which the curvature is reweighted.
constexpr double kLargeChange = 1.5;
const Eigen::Vector2d kNoticeable(0.0, 0.25e-6);

// Clock of an image that teaches noise.
constexpr double kClockKnown_s = 0.003;
constexpr double kClockApplied_s = 0.003;
constexpr int kSightingsToBeOld = 10;
}  // namespace

bool teaches_of_noise(const FilterState& state, int camera, std::span<const TagToUse> tags) {
  const CameraClock& clock = state.clocks[static_cast<std::size_t>(camera)];
  const double variance = state.P()(layout::clock(camera), layout::clock(camera));
  // A new tag shares the body's error, so that the motion relative to it shows no noise.
  const auto is_old = [&](const TagToUse& tag) {
    if (tag.local < 0) return true;
    const WorldTag& own = state.tags[static_cast<std::size_t>(tag.local)];
    return own.held || own.sightings >= kSightingsToBeOld;
  };
  return std::abs(clock.seconds_to(0)) < kClockApplied_s &&
         variance < kClockKnown_s * kClockKnown_s && std::ranges::all_of(tags, is_old);
}

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

double NoiseWatch::variance_inflation() const {
  return std::max(outgrown_, std::min(likely_variance_ / now_.applied(kImu), kMostInflation));
}

void NoiseWatch::unlearn() {
  now_ = LearnedNoise{};
  likely_variance_ = 1;
}

void NoiseWatch::follow(const MotionSinceImage& motion) {
  if (!motion.begun) return;
  for (BodyMatrix* const M : {&D_, &P_}) move_both_ways(motion.Phi, *M);
  D_ += motion.Q / now_.applied(kImu);
  P_ += motion.Q;
}

void NoiseWatch::learn(const StackedUpdate::SharedScore& score, const Vector6d& on_time) {
  const Matrix6d& A = score.information;
  const Vector6d& a = score.score;
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
    // Score test at the configured noise; afterwards the estimate alone decides.
    const double information = now_.information(noise, noise) + kTiny(noise);
    const double score = normal_score(now_.derivative(noise) / std::sqrt(information),
                                      now_.third(noise) / std::pow(information, 1.5));
    const bool is_significant =
        estimate(noise) > kDeclared(noise) && (was_beyond || score > kSignificant_sigma);
    now_.applied(noise) =
        is_significant ? std::min(estimate(noise), kMost(noise)) : kDeclared(noise);
    if (noise == kImu)
      likely_variance_ = score > kLikelyNoise_sigma ? estimate(noise) : kDeclared(noise);
  }
  outgrown_ = 1 + kForget * (outgrown_ - 1);
  outgrown_ = std::clamp(outgrown_ * now_.applied(kImu) / before(kImu), 1.0, kMostInflation);
  now_.derivative -= now_.information * (now_.applied - before);  // at the applied variances
  reweigh();
}

/// Reduces the earlier information about a variance that grows.
void NoiseWatch::reweigh() {
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
  if (density > kReportedNoise)
    out.push_back({.kind = Kind::kImuNoise,
                   .value = density,
                   .sigma = std::sqrt(curvature().inverse()(kImu, kImu)) / (2 * density)});
  if (jitter_s() > kReportedJitter_s)
    out.push_back({.kind = Kind::kStampJitter, .value = jitter_s()});
}

void NoiseWatch::correct(const StackedUpdate::SharedScore& score, const Vector6d& on_time) {
  // With the jitter of the stamp as image noise: (R + τ² H o oᵀ Hᵀ)⁻¹ in terms of the pose.
  const Vector6d Ao = score.by_known_tags * on_time;
  const double jitter = now_.applied(kStamps) / (1 + now_.applied(kStamps) * on_time.dot(Ao));
  const Matrix6d A = score.by_known_tags - jitter * Ao * Ao.transpose();
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
