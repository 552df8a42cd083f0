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
using Samples = Eigen::Matrix<double, kSamples, 1>;
using Picture = Eigen::Matrix<double, kSamples, 4>;

// All in modules.
constexpr double kLeastSmear = 0.2;
constexpr double kMostSmear = 2.0;  // beyond, the second row of bits is seen, too
constexpr double kMostOff = 0.5;
constexpr double kMostStep = 0.25;
constexpr double kDifference = 0.02;
constexpr double kSettled = 1e-3;
constexpr int kRounds = 8;
// Of the step between black and white, RMS.
constexpr double kMostUnexplained = 0.05;
constexpr double kBeyond = 0.3;  // how far bits may lie outside of black and white
// Fits that begin too sharp end in another minimum.
constexpr std::array kMoreSmear{0.0, 0.4, 0.8};

/// How much of each gray (bits, border, quiet zone, wall) is in each sample.
Picture picture_of(double edge, double smear) {
  Picture out;
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

Rest rest_of(const Samples& gray, double edge, double smear) {
  const Picture A = picture_of(edge, smear);
  Eigen::Matrix4d N = A.transpose() * A;
  N.diagonal().array() += 1e-6;  // a gray that is not seen stays at zero
  Rest out;
  out.grays = N.llt().solve(A.transpose() * gray);
  out.left = gray - A * out.grays;
  return out;
}

struct Fit {
  double edge{};
  double smear{};
  Rest rest;

  [[nodiscard]] double step() const { return rest.grays(2) - rest.grays(1); }
};

/// Gauss–Newton over edge and smear; the grays follow from them at once.
std::optional<Fit> fit_from(const Samples& samples, double smear) {
  double edge = 0;
  for (int round = 0; round < kRounds; ++round) {
    const Samples left = rest_of(samples, edge, smear).left;
    Eigen::Matrix<double, kSamples, 2> J;
    J.col(0) = (rest_of(samples, edge + kDifference, smear).left - left) / kDifference;
    J.col(1) = (rest_of(samples, edge, smear + kDifference).left - left) / kDifference;
    const Eigen::Matrix2d N = J.transpose() * J;
    const Eigen::Vector2d step = -N.inverse() * (J.transpose() * left);
    if (!step.allFinite()) return std::nullopt;
    edge += std::clamp(step.x(), -kMostStep, kMostStep);
    smear =
        std::clamp(smear + std::clamp(step.y(), -kMostStep, kMostStep), kLeastSmear, kMostSmear);
    if (!(std::abs(edge) < kMostOff)) return std::nullopt;
    if (std::abs(step.x()) < kSettled) break;
  }
  return Fit{edge, smear, rest_of(samples, edge, smear)};
}

bool is_tag(const Fit& fit) {
  const double step = fit.step();
  if (!(step > 0)) return false;
  const double bits = (fit.rest.grays(0) - fit.rest.grays(1)) / step;
  const double wall = (fit.rest.grays(3) - fit.rest.grays(1)) / step;
  return bits > -kBeyond && bits < 1 + kBeyond && wall > -1 && wall < 1 + kBeyond &&
         fit.rest.left.norm() < kMostUnexplained * step * std::sqrt(kSamples);
}

}  // namespace

std::optional<double> find_smeared_side(const SideProfile& gray, double smear) {
  const Samples samples = Eigen::Map<const Samples>(gray.data());
  std::optional<Fit> best;
  for (const double more : kMoreSmear) {
    const auto fit = fit_from(samples, std::clamp(smear + more, kLeastSmear, kMostSmear));
    if (!fit || !is_tag(*fit)) continue;
    if (!best || fit->rest.left.squaredNorm() < best->rest.left.squaredNorm()) best = fit;
  }
  if (!best) return std::nullopt;
  return best->edge;
}

}  // namespace fiducap
