#include "detection/smeared_side.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace fiducap {

namespace {

constexpr int kSamples = static_cast<int>(std::tuple_size_v<SideProfile>);
constexpr int kRows = kSamples + 2;  // what is known of black and white counts as two more
using Samples = Eigen::Matrix<double, kRows, 1>;
using Picture = Eigen::Matrix<double, kRows, 4>;

// All in modules.
constexpr double kLeastSmear = 0.2;
constexpr double kMostSmear = 2.0;  // beyond, the second row of bits is seen, too
constexpr double kMostOff = 0.7;
constexpr double kMostStep = 0.25;
constexpr double kDifference = 0.02;
constexpr double kSettled = 1e-3;
constexpr int kRounds = 8;
// Black and white are known to a few hundredths of their difference, samples to less than one.
constexpr double kOfLevels = 0.3;
// Of the step between black and white, RMS.
constexpr double kMostUnexplained = 0.05;
constexpr double kBeyond = 0.3;  // how far bits may lie outside of black and white
// Fits that begin too sharp, or too far off, end in another minimum. Where black and white are
// known, the first one that explains the profile so well is right.
constexpr double kExplained = 0.008;
struct Begin {
  double edge;
  double more_smear;
};
constexpr std::array kBegins{Begin{0, 0},   Begin{0, 0.4},    Begin{0, 0.8},  Begin{-0.4, 0},
                             Begin{0.4, 0}, Begin{-0.4, 0.4}, Begin{0.4, 0.4}};

/// What is looked at.
struct Look {
  Samples samples;
  double of_levels{0};  ///< Weight of what is known of black and white, against a sample's.

  Look(const SideProfile& gray, const std::optional<TagLevels>& levels) {
    samples.head<kSamples>() = Eigen::Map<const Eigen::Matrix<double, kSamples, 1>>(gray.data());
    samples.tail<2>().setZero();
    if (!levels) return;
    of_levels = kOfLevels;
    samples.tail<2>() << kOfLevels * levels->black, kOfLevels * levels->white;
  }
};

/// How much of each gray (bits, border, quiet zone, wall) is in each sample.
Picture picture_of(double edge, double smear, double of_levels) {
  Picture out;
  out.bottomRows<2>() << 0, of_levels, 0, 0, 0, 0, of_levels, 0;
  for (int j = 0; j < kSamples; ++j) {
    const double t = -1 + 2.0 * j / (kSamples - 1);
    const auto inside_of = [&](double x) { return std::clamp((x - t) / smear + 0.5, 0.0, 1.0); };
    const double bits = inside_of(edge - 1);
    const double black = inside_of(edge);
    const double white = inside_of(edge + 1);
    out.row(j) << bits, black - bits, white - black, 1 - white;
  }
  return out;
}

/// The grays that fit best, and what they leave.
struct Rest {
  Eigen::Vector4d grays;
  Samples left;
};

Rest rest_of(const Look& look, double edge, double smear) {
  const Picture A = picture_of(edge, smear, look.of_levels);
  Eigen::Matrix4d N = A.transpose() * A;
  N.diagonal().array() += 1e-6;  // a gray that is not seen stays at zero
  Rest out;
  out.grays = N.llt().solve(A.transpose() * look.samples);
  out.left = look.samples - A * out.grays;
  return out;
}

struct Fit {
  double edge{};
  double smear{};
  Rest rest;

  [[nodiscard]] double step() const { return rest.grays(2) - rest.grays(1); }
  /// RMS, of the step between black and white.
  [[nodiscard]] double unexplained() const {
    return rest.left.norm() / (step() * std::sqrt(double{kSamples}));
  }
};

/// Gauss–Newton over edge and smear; the grays follow from them at once.
std::optional<Fit> fit_from(const Look& look, double edge, double smear) {
  for (int round = 0; round < kRounds; ++round) {
    const Samples left = rest_of(look, edge, smear).left;
    Eigen::Matrix<double, kRows, 2> J;
    J.col(0) = (rest_of(look, edge + kDifference, smear).left - left) / kDifference;
    J.col(1) = (rest_of(look, edge, smear + kDifference).left - left) / kDifference;
    const Eigen::Matrix2d N = J.transpose() * J;
    const Eigen::Vector2d step = -N.inverse() * (J.transpose() * left);
    if (!step.allFinite()) return std::nullopt;
    edge += std::clamp(step.x(), -kMostStep, kMostStep);
    smear =
        std::clamp(smear + std::clamp(step.y(), -kMostStep, kMostStep), kLeastSmear, kMostSmear);
    if (!(std::abs(edge) < kMostOff)) return std::nullopt;
    if (std::abs(step.x()) < kSettled) break;
  }
  return Fit{edge, smear, rest_of(look, edge, smear)};
}

bool is_tag(const Fit& fit) {
  const double step = fit.step();
  if (!(step > 0)) return false;
  const double bits = (fit.rest.grays(0) - fit.rest.grays(1)) / step;
  const double wall = (fit.rest.grays(3) - fit.rest.grays(1)) / step;
  return bits > -kBeyond && bits < 1 + kBeyond && wall > -1 && wall < 1 + kBeyond &&
         fit.unexplained() < kMostUnexplained;
}

}  // namespace

std::optional<SmearedSide> find_smeared_side(const SideProfile& gray, double smear,
                                             const std::optional<TagLevels>& levels) {
  const Look look(gray, levels);
  std::optional<Fit> best;
  for (const Begin& begin : kBegins) {
    if (!levels && begin.edge != 0) break;
    const auto fit =
        fit_from(look, begin.edge, std::clamp(smear + begin.more_smear, kLeastSmear, kMostSmear));
    if (!fit || !is_tag(*fit)) continue;
    if (!best || fit->unexplained() < best->unexplained()) best = fit;
    if (levels && best->unexplained() < kExplained) break;
  }
  if (!best) return std::nullopt;
  return SmearedSide{best->edge, best->smear};
}

}  // namespace fiducap
