#include "pipeline/agreement/agreement_finding.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/so3.hpp"

namespace fiducap {

namespace {

using Kind = AgreementFinding::Kind;

constexpr double kDegree = std::numbers::pi / 180;

// A clock may have jumped: only what came last tells of it.
constexpr std::size_t kPairsOfClock = 20;
// What a right fit leaves: of the motion at most, and in units of the corners' noise.
constexpr double kUnexplained = 0.35;
constexpr double kMisfit = 2.5;
constexpr double kWellExplained = 0.1;
constexpr double kInliers = 0.75;
constexpr double kLeastTurns_rad = 3 * kDegree;
// Another cause is believed when it is better by so many squares of sigma. Turns overlap, so three
// of them count for one.
constexpr double kEvidence = 25;
constexpr double kSomeEvidence = 16;
constexpr double kTurnsPerIndependent = 3;
constexpr double kRightMisfit = 0.6;  // what is below it is luck
// Smaller errors of the axes are for the filter to estimate.
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

/// For the first against the second of two fits of the same turns, in squares of sigma.
double evidence(const TurnFit& better, const TurnFit& worse) {
  return 3 * static_cast<double>(better.kept) * (worse.misfit - better.misfit) /
         (kTurnsPerIndependent * std::max(better.misfit, kRightMisfit));
}

/// No shift further away does nearly as well.
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

/// Further than a filter can estimate. About an axis that is hardly known, by what the configured
/// axes leave unexplained.
bool is_far_turned(const TurnFit& turned, const TurnFit& configured) {
  const double share = 2 * std::sin(kAxesTolerance_rad);  // of a turn: what twice as much leaves
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

/// Other axes that explain what those of `configured` do not.
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

/// The body turns about enough axes to know that the gyro is not mirrored.
bool excludes_reflection(std::span<const TurnPair> pairs, const Range& range,
                         const TurnFit& configured) {
  const auto reflected = fit_turns(pairs, AxesTried::kReflected, range.from_s, range.to_s);
  return evidence(configured, reflected) > kEvidence;
}

}  // namespace

double AgreementFinding::angle_rad() const { return angle_of(A); }

std::optional<AgreementFinding> find_cause(std::span<const TurnPair> pairs,
                                           const ExpectedShift& expected) {
  const Range told{std::max(expected.shift_s - expected.tolerance_s, -furthest_s()),
                   std::min(expected.shift_s + expected.tolerance_s, furthest_s())};
  if (pairs.empty() || told.from_s >= told.to_s) return {};
  const auto last =
      expected.was_measured ? pairs.last(std::min(pairs.size(), kPairsOfClock)) : pairs;
  const auto as_told = fit_turns(last, AxesTried::kAsConfigured, told.from_s, told.to_s);
  const auto shifted = fit_turns(last, AxesTried::kAsConfigured, -furthest_s(), furthest_s());
  const bool clock_is_right = evidence(shifted, as_told) < kEvidence;
  if (clock_is_right && explains(as_told)) {
    const auto all = fit_turns(pairs, AxesTried::kAsConfigured, told.from_s, told.to_s);
    if (auto axes = find_axes(pairs, {all.shift_s, all.shift_s}, all)) return axes;
    AgreementFinding agree = finding_of(Kind::kAgree, as_told);
    agree.A = fit_turns(pairs, AxesTried::kTurned, all.shift_s, all.shift_s).A;
    agree.axes_sigma_rad = all.axes_sigma_rad;
    if (expected.axes_were_wrong && !excludes_reflection(pairs, told, all)) return {};
    return agree;
  }
  if (!clock_is_right && explains(shifted)) {
    const bool is_far = std::abs(shifted.shift_s - expected.shift_s) >
                        expected.tolerance_s + kShiftSigmas * shifted.shift_sigma_s;
    if (!is_far || std::abs(shifted.shift_s) > kNearEdge_s || !is_unique(last, shifted)) return {};
    return finding_of(expected.was_measured ? Kind::kJumped : Kind::kShifted, shifted);
  }
  if (auto axes = find_axes(pairs, told,
                            fit_turns(pairs, AxesTried::kAsConfigured, told.from_s, told.to_s)))
    return axes;
  const auto any = fit_turns(pairs, AxesTried::kAsConfigured, -furthest_s(), furthest_s());
  return find_axes(pairs, {-kNearEdge_s, kNearEdge_s}, any);
}

}  // namespace fiducap
