#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "base/expected.hpp"
#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "pipeline/agreement/turns.hpp"

namespace fiducap {
namespace {

constexpr double kKept = 0.75;
constexpr int kRounds = 3;
// Errors of gyro, rolling shutter and jitter of stamps.
constexpr double kFloor_rad = 0.01;
// The omitted quarter would have made the scatter larger, and turns with a common image share its
// noise.
constexpr double kVarianceOfKept = 3.0;
constexpr double kLeastMisfit = 0.5;
// Beyond, a turn is an outlier.
constexpr double kInlierSigmas = 4.0;

double weight(const TurnPair& pair) {
  return 1 / (pair.sigma_rad * pair.sigma_rad + kFloor_rad * kFloor_rad);
}

/// The turns at one shift, of which the better ones are used.
struct Scratch {
  struct Turn {
    Eigen::Vector3d camera;
    Eigen::Vector3d gyro;
    double weight{};
    double misfit{};
  };
  std::array<Turn, kMostPairs> turns;
  std::size_t count{};
  std::size_t kept{};
  Eigen::Matrix3d A{Eigen::Matrix3d::Identity()};
  double cost{};

  Scratch(std::span<const TurnPair> pairs, double shift_s)
      : count(pairs.size()), kept(pairs.size()) {
    for (std::size_t i = 0; i < count; ++i)
      turns[i] = {pairs[i].camera, pairs[i].gyro_at(shift_s), weight(pairs[i]), 0};
  }
  [[nodiscard]] std::span<const Turn> better() const { return {turns.data(), kept}; }

  void keep_better() {
    for (std::size_t i = 0; i < count; ++i)
      turns[i].misfit = turns[i].weight * (turns[i].gyro - A * turns[i].camera).squaredNorm();
    kept = static_cast<std::size_t>(std::ceil(kKept * static_cast<double>(count)));
    std::nth_element(turns.begin(), turns.begin() + static_cast<std::ptrdiff_t>(kept) - 1,
                     turns.begin() + static_cast<std::ptrdiff_t>(count),
                     [](const Turn& a, const Turn& b) { return a.misfit < b.misfit; });
    cost = 0;
    for (const Turn& turn : better()) cost += turn.misfit;
  }

  /// Kabsch's rotation, or the reflection that fits best.
  void turn_axes(double determinant) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    for (const Turn& turn : better()) H += turn.weight * turn.gyro * turn.camera.transpose();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d UVt = svd.matrixU() * svd.matrixV().transpose();
    const double sign = UVt.determinant() * determinant < 0 ? -1 : 1;
    A = svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  }
};

Scratch scratch_at(std::span<const TurnPair> pairs, AxesTried axes, double shift_s) {
  Scratch scratch(pairs, shift_s);
  if (axes != AxesTried::kAsConfigured) {
    for (int round = 0; round < kRounds; ++round) {
      scratch.turn_axes(axes == AxesTried::kReflected ? -1 : 1);
      scratch.keep_better();
    }
  } else {
    scratch.keep_better();
  }
  return scratch;
}

double best_shift(std::span<const TurnPair> pairs, AxesTried axes, double from_s, double to_s) {
  double best_s = from_s;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](double shift_s) {
    const double cost = scratch_at(pairs, axes, shift_s).cost;
    if (cost >= least) return;
    least = cost;
    best_s = shift_s;
  };
  consider(from_s);
  for (std::size_t lag = 0; lag < lags::kCount; ++lag) {
    const double shift_s = lags::seconds(lag);
    if (shift_s > from_s && shift_s < to_s) consider(shift_s);
  }
  consider(to_s);
  constexpr double kStep_s = 0.5 * lags::kStep_s;
  const double before_s = std::max(best_s - kStep_s, lags::seconds(0));
  const double after_s = std::min(best_s + kStep_s, lags::seconds(lags::kCount - 1));
  const double step = minimum_of_parabola(scratch_at(pairs, axes, before_s).cost, least,
                                          scratch_at(pairs, axes, after_s).cost);
  return std::clamp(best_s + kStep_s * step, from_s, to_s);
}

void describe_motion(const Scratch& scratch, TurnFit& fit) {
  double motion = 0;
  Eigen::Matrix3d gg = Eigen::Matrix3d::Zero();
  for (const auto& turn : scratch.better()) {
    motion += turn.weight * 0.5 * (turn.camera.squaredNorm() + turn.gyro.squaredNorm());
    gg += turn.gyro * turn.gyro.transpose() / static_cast<double>(scratch.kept);
  }
  fit.kept = scratch.kept;
  fit.misfit = scratch.cost / (3 * static_cast<double>(scratch.kept));
  fit.unexplained = motion > 0 ? scratch.cost / motion : 2;
  fit.excitation_rad2 = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(gg, Eigen::EigenvaluesOnly)
                            .eigenvalues()
                            .reverse();
}

/// @return variance of a turn with weight 1 about the fit
double scatter_of(const Scratch& scratch) {
  return kVarianceOfKept *
         std::max(scratch.cost / (3 * static_cast<double>(scratch.kept)), kLeastMisfit);
}

void describe_certainty(std::span<const TurnPair> pairs, const Scratch& scratch, TurnFit& fit) {
  const double scatter = scatter_of(scratch);
  double by_time = 0;
  for (const TurnPair& pair : pairs) {
    const Eigen::Vector3d rate =
        (pair.gyro_at(fit.shift_s + lags::kStep_s) - pair.gyro_at(fit.shift_s - lags::kStep_s)) /
        (2 * lags::kStep_s);
    by_time += weight(pair) * rate.squaredNorm();
  }
  fit.shift_sigma_s = std::sqrt(scatter / std::max(by_time, 1e-12));
  Eigen::Matrix3d by_axes = Eigen::Matrix3d::Zero();
  for (const auto& turn : scratch.better())
    by_axes += turn.weight * (turn.gyro.squaredNorm() * Eigen::Matrix3d::Identity() -
                              turn.gyro * turn.gyro.transpose());
  const double least =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(by_axes, Eigen::EigenvaluesOnly)
          .eigenvalues()(0);
  fit.axes_sigma_rad = std::sqrt(scatter / std::max(least, 1e-12));
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < scratch.count; ++i)
    inliers += scratch.turns[i].misfit < kInlierSigmas * kInlierSigmas * scatter ? 1 : 0;
  fit.inliers = static_cast<double>(inliers) / static_cast<double>(scratch.count);
}

using Kind = AgreementFinding::Kind;

// Only the newest turns show a jump of the clock.
constexpr std::size_t kPairsOfClock = 20;
// Residuals of a correct fit: share of the motion, and in units of the corner noise.
constexpr double kUnexplained = 0.35;
constexpr double kMisfit = 2.5;
constexpr double kWellExplained = 0.1;
constexpr double kInliers = 0.75;
constexpr double kLeastTurns_rad = 3 * kDegree;
// Another cause is accepted when it is better by this many squares of sigma. Turns overlap, so
// three of them count for one.
constexpr double kEvidence = 25;
constexpr double kSomeEvidence = 16;
constexpr double kTurnsPerIndependent = 3;
constexpr double kRightMisfit = 0.6;  // less is by chance
// The filter estimates smaller errors of the axes.
constexpr double kAxesTolerance_rad = 10 * kDegree;
constexpr double kShiftSigmas = 3;
constexpr double kNearEdge_s = 0.76;
constexpr double kOtherShift_s = 0.15;

double furthest_s() { return lags::seconds(lags::kCount - 1); }

bool explains(const TurnFit& fit) {
  const bool by_noise = fit.unexplained < kUnexplained && fit.misfit < kMisfit;
  return (by_noise || fit.unexplained < kWellExplained) && fit.inliers >= kInliers &&
         fit.excitation_rad2(0) > kLeastTurns_rad * kLeastTurns_rad;
}

/// Of the first against the second fit of the same turns, in squares of sigma.
double evidence(const TurnFit& better, const TurnFit& worse) {
  return 3 * static_cast<double>(better.kept) * (worse.misfit - better.misfit) /
         (kTurnsPerIndependent * std::max(better.misfit, kRightMisfit));
}

/// No other shift fits nearly as well.
bool is_unique(std::span<const TurnPair> pairs, const TurnFit& fit) {
  const auto rivals = [&](double from_s, double to_s) {
    if (from_s >= to_s) return false;
    return evidence(fit, fit_turns(pairs, AxesTried::kAsConfigured, from_s, to_s)) < kSomeEvidence;
  };
  return !rivals(-furthest_s(), fit.shift_s - kOtherShift_s) &&
         !rivals(fit.shift_s + kOtherShift_s, furthest_s());
}

double angle_of(const Eigen::Matrix3d& rotation) {
  return log_so3(Eigen::Quaterniond(rotation)).norm();
}

/// Further than a filter can estimate. About a poorly determined axis: by the motion that the
/// configured axes leave unexplained.
bool is_far_turned(const TurnFit& turned, const TurnFit& configured) {
  const double share = 2 * std::sin(kAxesTolerance_rad);  // of a turn, for twice the tolerance
  return angle_of(turned.A) > kAxesTolerance_rad + 3 * turned.axes_sigma_rad ||
         configured.unexplained - turned.unexplained > share * share;
}

AgreementFinding finding_of(Kind kind, const TurnFit& fit) {
  return {kind, fit.A, fit.axes_sigma_rad, fit.shift_s, fit.shift_sigma_s, 0};
}

struct Range {
  double from_s;
  double to_s;
};

/// Other axes, if they explain more than those of `configured`.
std::optional<AgreementFinding> find_axes(std::span<const TurnPair> pairs, const Range& range,
                                          const TurnFit& configured) {
  const TurnFit turned = fit_turns(pairs, AxesTried::kTurned, range.from_s, range.to_s);
  const TurnFit reflected = fit_turns(pairs, AxesTried::kReflected, range.from_s, range.to_s);
  const bool is_turned = turned.misfit <= reflected.misfit;
  const TurnFit& better = is_turned ? turned : reflected;
  if (!explains(better) || evidence(better, configured) < kEvidence) return {};
  if (is_turned && !is_far_turned(turned, configured)) return {};
  if (evidence(better, is_turned ? reflected : turned) < kSomeEvidence)
    return finding_of(Kind::kAxesApart, better);
  return finding_of(is_turned ? Kind::kAxesTurned : Kind::kAxesReflected, better);
}

/// The body turns about enough axes to exclude a mirrored gyro.
bool excludes_reflection(std::span<const TurnPair> pairs, const Range& range,
                         const TurnFit& configured) {
  const auto reflected = fit_turns(pairs, AxesTried::kReflected, range.from_s, range.to_s);
  return evidence(configured, reflected) > kEvidence;
}

}  // namespace

Eigen::Vector3d TurnPair::gyro_at(double shift_s) const {
  const double place =
      std::clamp(shift_s / lags::kStep_s + lags::kSide, 0.0, static_cast<double>(lags::kCount - 1));
  const auto before = std::min(static_cast<std::size_t>(place), lags::kCount - 2);
  const double share = place - static_cast<double>(before);
  return (1 - share) * gyro[before].cast<double>() + share * gyro[before + 1].cast<double>();
}

TurnFit fit_turns(std::span<const TurnPair> pairs, AxesTried axes, double shift_from_s,
                  double shift_to_s) {
  FIDUCAP_ASSERT(!pairs.empty() && pairs.size() <= kMostPairs && shift_from_s <= shift_to_s);
  TurnFit fit;
  fit.shift_s = best_shift(pairs, axes, shift_from_s, shift_to_s);
  const Scratch scratch = scratch_at(pairs, axes, fit.shift_s);
  fit.A = scratch.A;
  describe_motion(scratch, fit);
  describe_certainty(pairs, scratch, fit);
  return fit;
}

double AgreementFinding::angle_rad() const { return angle_of(A); }

std::optional<AgreementFinding> find_cause(std::span<const TurnPair> pairs,
                                           const ExpectedShift& expected) {
  const Range range{std::max(expected.shift_s - expected.tolerance_s, -furthest_s()),
                    std::min(expected.shift_s + expected.tolerance_s, furthest_s())};
  if (pairs.empty() || range.from_s >= range.to_s) return {};
  const auto last =
      expected.was_measured ? pairs.last(std::min(pairs.size(), kPairsOfClock)) : pairs;
  const auto as_expected = fit_turns(last, AxesTried::kAsConfigured, range.from_s, range.to_s);
  const auto shifted = fit_turns(last, AxesTried::kAsConfigured, -furthest_s(), furthest_s());
  const bool clock_is_right = evidence(shifted, as_expected) < kEvidence;
  if (clock_is_right && explains(as_expected)) {
    const auto all = fit_turns(pairs, AxesTried::kAsConfigured, range.from_s, range.to_s);
    if (auto axes = find_axes(pairs, {all.shift_s, all.shift_s}, all)) return axes;
    AgreementFinding agree = finding_of(Kind::kAgree, as_expected);
    agree.A = fit_turns(pairs, AxesTried::kTurned, all.shift_s, all.shift_s).A;
    agree.axes_sigma_rad = all.axes_sigma_rad;
    if (expected.axes_were_wrong && !excludes_reflection(pairs, range, all)) return {};
    return agree;
  }
  if (!clock_is_right && explains(shifted)) {
    const bool is_far = std::abs(shifted.shift_s - expected.shift_s) >
                        expected.tolerance_s + kShiftSigmas * shifted.shift_sigma_s;
    if (!is_far || std::abs(shifted.shift_s) > kNearEdge_s || !is_unique(last, shifted)) return {};
    return finding_of(expected.was_measured ? Kind::kJumped : Kind::kShifted, shifted);
  }
  if (auto axes = find_axes(pairs, range,
                            fit_turns(pairs, AxesTried::kAsConfigured, range.from_s, range.to_s)))
    return axes;
  const auto any = fit_turns(pairs, AxesTried::kAsConfigured, -furthest_s(), furthest_s());
  return find_axes(pairs, {-kNearEdge_s, kNearEdge_s}, any);
}

}  // namespace fiducap
