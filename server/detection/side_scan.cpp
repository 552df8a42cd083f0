#include "detection/side_scan.hpp"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace fiducap {
namespace {

constexpr double kStep_px = 0.25;
constexpr double kBalanceStep_px = 0.2;
constexpr double kLevelStep_px = 0.5;
// The bias by the next cells is proportional to the square of the missing width; fitted to 4200
// rendered scenes (walls darker than paper) and, for other walls, to squares with pixels averaged
// over their area. Lenses less sharp than a pixel double it.
constexpr double kMinCell_px = 1.1;
constexpr double kBiasOfBits = 0.0245;
constexpr double kBiasOfWall = 0.0224;

/// |w|^0.75 with the sign of w: a darker wall adds less than in proportion.
double wall_effect(double of_wall) {
  return std::copysign(std::sqrt(std::abs(of_wall) * std::sqrt(std::abs(of_wall))), of_wall);
}

constexpr int kSamples = static_cast<int>(std::tuple_size_v<SideProfile>);
constexpr int kRows = kSamples + 2;  // two more measurements: known black and white
using Samples = Eigen::Matrix<double, kRows, 1>;
using Mixture = Eigen::Matrix<double, kRows, 4>;

// All in cells.
constexpr double kMinBlur = 0.2;
constexpr double kMaxBlur = 2.0;  // beyond, the second row of bits contributes
constexpr double kMaxOffset = 0.7;
constexpr double kMaxStep = 0.25;
constexpr double kDifference = 0.02;
constexpr double kSettled = 1e-3;
constexpr int kRounds = 8;
// Weight of known levels against samples: they are known to a few hundredths of their difference.
constexpr double kLevelsWeight = 0.3;
// RMS, relative to the step between black and white.
constexpr double kMaxUnexplained = 0.05;
constexpr double kBeyond = 0.3;  // excess of bits over black and white
// A start with too little blur or a wrong position ends in another minimum. With known black and
// white, the first fit below this residual is accepted.
constexpr double kExplained = 0.008;
struct Start {
  double edge;
  double more_blur;
};
constexpr std::array kStarts{Start{0, 0},   Start{0, 0.4},    Start{0, 0.8},  Start{-0.4, 0},
                             Start{0.4, 0}, Start{-0.4, 0.4}, Start{0.4, 0.4}};

/// The measurements of a fit.
struct ProfileSamples {
  Samples samples;
  double levels_weight{0};  ///< 0: no known levels.

  ProfileSamples(const SideProfile& gray, const std::optional<TagLevels>& levels) {
    samples.head<kSamples>() = Eigen::Map<const Eigen::Matrix<double, kSamples, 1>>(gray.data());
    samples.tail<2>().setZero();
    if (!levels) return;
    levels_weight = kLevelsWeight;
    samples.tail<2>() << kLevelsWeight * levels->black, kLevelsWeight * levels->white;
  }
};

/// Share of each gray (bits, border, quiet zone, wall) in each sample.
Mixture mixture_of(double edge, double blur, double levels_weight) {
  Mixture out;
  out.bottomRows<2>() << 0, levels_weight, 0, 0, 0, 0, levels_weight, 0;
  for (int j = 0; j < kSamples; ++j) {
    const double t = -1 + 2.0 * j / (kSamples - 1);
    const auto inside_of = [&](double x) { return std::clamp((x - t) / blur + 0.5, 0.0, 1.0); };
    const double bits = inside_of(edge - 1);
    const double black = inside_of(edge);
    const double white = inside_of(edge + 1);
    out.row(j) << bits, black - bits, white - black, 1 - white;
  }
  return out;
}

/// Least-squares grays for an edge and a blur, with their residuals.
struct GrayFit {
  Eigen::Vector4d grays;
  Samples residuals;
};

GrayFit fit_grays(const ProfileSamples& profile, double edge, double blur) {
  const Mixture A = mixture_of(edge, blur, profile.levels_weight);
  Eigen::Matrix4d N = A.transpose() * A;
  N.diagonal().array() += 1e-6;  // grays outside of the profile stay at zero
  GrayFit out;
  out.grays = N.llt().solve(A.transpose() * profile.samples);
  out.residuals = profile.samples - A * out.grays;
  return out;
}

struct EdgeFit {
  double edge{};
  double blur{};
  GrayFit grays;

  [[nodiscard]] double step() const { return grays.grays(2) - grays.grays(1); }
  /// RMS, relative to the step between black and white.
  [[nodiscard]] double unexplained() const {
    return grays.residuals.norm() / (step() * std::sqrt(double{kSamples}));
  }
};

/// Gauss–Newton over edge and blur; the grays are linear (variable projection).
std::optional<EdgeFit> fit_from(const ProfileSamples& profile, double edge, double blur) {
  for (int round = 0; round < kRounds; ++round) {
    const Samples residuals = fit_grays(profile, edge, blur).residuals;
    Eigen::Matrix<double, kRows, 2> J;
    J.col(0) = (fit_grays(profile, edge + kDifference, blur).residuals - residuals) / kDifference;
    J.col(1) = (fit_grays(profile, edge, blur + kDifference).residuals - residuals) / kDifference;
    const Eigen::Matrix2d N = J.transpose() * J;
    const Eigen::Vector2d step = -N.inverse() * (J.transpose() * residuals);
    if (!step.allFinite()) return std::nullopt;
    edge += std::clamp(step.x(), -kMaxStep, kMaxStep);
    blur = std::clamp(blur + std::clamp(step.y(), -kMaxStep, kMaxStep), kMinBlur, kMaxBlur);
    if (!(std::abs(edge) < kMaxOffset)) return std::nullopt;
    if (std::abs(step.x()) < kSettled) break;
  }
  return EdgeFit{edge, blur, fit_grays(profile, edge, blur)};
}

bool is_tag(const EdgeFit& fit) {
  const double step = fit.step();
  if (!(step > 0)) return false;
  const double bits = (fit.grays.grays(0) - fit.grays.grays(1)) / step;
  const double wall = (fit.grays.grays(3) - fit.grays.grays(1)) / step;
  return bits > -kBeyond && bits < 1 + kBeyond && wall > -1 && wall < 1 + kBeyond &&
         fit.unexplained() < kMaxUnexplained;
}

}  // namespace

Line principal_line(const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance) {
  const double angle = 0.5 * std::atan2(2 * covariance(0, 1), covariance(0, 0) - covariance(1, 1));
  const Eigen::Vector2d n(-std::sin(angle), std::cos(angle));
  return {n, n.dot(mean)};
}

Eigen::Vector2d intersection(const Line& a, const Line& b) {
  Eigen::Matrix2d N;
  N << a.n.transpose(), b.n.transpose();
  return N.inverse() * Eigen::Vector2d(a.c, b.c);
}

std::optional<Line> LineFit::line() const {
  if (points_ < kMinPoints) return std::nullopt;
  const Eigen::Vector2d mean = sum_ / points_;
  return principal_line(mean + origin_, squares_ / points_ - mean * mean.transpose());
}

std::optional<SideScan::Rise> SideScan::rise(const Eigen::Vector2d& px,
                                             const Eigen::Vector2d& outward,
                                             double max_gray) const {
  double sum = 0;
  double squares = 0;
  double weight = 0;
  for (double t = -reach_px; t <= reach_px + 1e-9; t += kStep_px) {
    const Eigen::Vector2d outer = px + (t + gradient_px) * outward;
    const Eigen::Vector2d inner = px + (t - gradient_px) * outward;
    if (!holds(outer) || !holds(inner)) return std::nullopt;  // a part of a rise is biased
    const double rise = std::min(gray(outer), max_gray) - std::min(gray(inner), max_gray);
    if (rise <= 0) continue;
    sum += rise * rise * t;
    squares += rise * rise * t * t;
    weight += rise * rise;
  }
  if (weight <= 0) return std::nullopt;
  const double mean = sum / weight;
  return Rise{mean, squares / weight - mean * mean};
}

double SideScan::bias_px(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                         double cell_px) const {
  if (cell_px >= kWide_px) return 0;
  const Eigen::Vector2d cell = cell_px * outward;
  const Eigen::Vector2d bit = px - 1.5 * cell;
  const Eigen::Vector2d wall = px + 1.5 * cell;
  if (!holds(bit) || !holds(wall)) return 0;
  const double black = gray(px - 0.5 * cell);
  const double white = gray(px + 0.5 * cell);
  if (!(white > black)) return 0;
  const double of_bits = std::clamp((gray(bit) - black) / (white - black), 0.0, 1.0);
  const double of_wall = std::clamp((white - gray(wall)) / (white - black), -1.0, 1.0);
  const double missing_px = kWide_px - std::max(kMinCell_px, cell_px);
  return missing_px * missing_px * (kBiasOfBits * of_bits - kBiasOfWall * wall_effect(of_wall));
}

double SideScan::mean_gray(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                           double from_px, double to_px) const {
  const double width_px = to_px - from_px;
  const int steps = 1 + static_cast<int>(width_px / kLevelStep_px);
  double sum = 0;
  for (int j = 0; j < steps; ++j)
    sum += gray(px + (from_px + (j + 0.5) / steps * width_px) * outward);
  return sum / steps;
}

std::optional<double> SideScan::balance(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                                        double half_px, double uniform_px) const {
  if (!holds(px - uniform_px * outward) || !holds(px + uniform_px * outward)) return std::nullopt;
  const double black = mean_gray(px, outward, -uniform_px, -half_px);
  const double white = mean_gray(px, outward, half_px, uniform_px);
  if (!(white > black)) return std::nullopt;
  const int steps = static_cast<int>(std::ceil(2 * half_px / kBalanceStep_px));
  double sum = 0;
  for (int j = 0; j < steps; ++j)
    sum += gray(px + (2 * (j + 0.5) / steps - 1) * half_px * outward) - black;
  return half_px * (1 - 2 * sum / (steps * (white - black)));
}

std::optional<BlurredEdge> find_blurred_edge(const SideProfile& gray, double blur,
                                             const std::optional<TagLevels>& levels) {
  const ProfileSamples profile(gray, levels);
  std::optional<EdgeFit> best;
  for (const Start& start : kStarts) {
    if (!levels && start.edge != 0) break;
    const auto fit =
        fit_from(profile, start.edge, std::clamp(blur + start.more_blur, kMinBlur, kMaxBlur));
    if (!fit || !is_tag(*fit)) continue;
    if (!best || fit->unexplained() < best->unexplained()) best = fit;
    if (levels && best->unexplained() < kExplained) break;
  }
  if (!best) return std::nullopt;
  return BlurredEdge{best->edge, best->blur};
}

}  // namespace fiducap
