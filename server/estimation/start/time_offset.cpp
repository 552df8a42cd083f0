#include "estimation/start/time_offset.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"

namespace fiducap {
namespace {

// Span of a turn: longer ones are more accurate, within the second order.
constexpr Duration kShortest = std::chrono::milliseconds(190);
constexpr Duration kBest = std::chrono::milliseconds(400);
constexpr Duration kLongest = std::chrono::milliseconds(620);
constexpr Duration kImagePeriod = std::chrono::milliseconds(90);
// Images later than all offsets that are tried, by which an order of arrival has no effect.
constexpr Duration kOnTheWay = std::chrono::milliseconds(250);
// rad: smaller turns at every offset contain nothing but noise.
constexpr double kSmallestTurn_rad = 0.05;
// rad, 1-sigma per axis of a turn, besides the corners': lens, shutter and third order.
constexpr double kOther_rad = 0.005;

// Degrees of freedom of Student's distribution.
constexpr double kNu = 4;
// rad per axis, 1-sigma: axes that a filter can estimate. A rotation is reported from about seven
// of them, 14°, on.
constexpr double kAxesPrior_rad = 2 * kDegree;
// −2 log of the prior density of a rotation among all of them (volume 8π²) relative to that.
const double kAnyRotation =
    2 * std::log(8 * std::pow(std::numbers::pi, 2) /
                 std::pow(std::sqrt(2 * std::numbers::pi) * kAxesPrior_rad, 3));
// A parameter's index in a solution: rotation of the axes, bias, offset.
constexpr int kPhi = 0;
constexpr int kBias = 3;
constexpr int kShift = 6;
using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

/// 1/sigma² of the axes and the bias.
Vector7d priors(Axes axes) {
  Vector7d prior = Vector7d::Zero();
  const double sigma_rad = axes == Axes::kConfigured ? kAxesPrior_rad : 1;  // 1: any
  prior.segment<3>(kPhi).setConstant(1 / (sigma_rad * sigma_rad));
  prior.segment<3>(kBias).setConstant(
      1 / (filter_rules::kStartBiasW_rad_s * filter_rules::kStartBiasW_rad_s));
  return prior;
}

// Offsets in sigmas of their prior that are tried.
constexpr double kReach_sigma = 6;
// s: another offset; nearer ones belong to the same minimum (half a turn).
constexpr double kOther_s = 0.15;
constexpr int kRounds = 3;  // of reweighting

// Largest residuals of a right fit: of the modelled variance (corners may be twice as noisy), and
// of the motion, when it is by far larger.
constexpr double kMisfit = 4;
constexpr double kUnexplained = 0.35;
constexpr double kWellExplained = 0.1;
constexpr double kMedian3 = 2.37;  // of a chi-square of three degrees of freedom

}  // namespace

bool OffsetFit::explains() const {
  return (unexplained < kUnexplained && misfit < kMisfit) || unexplained < kWellExplained;
}

/// Minimum of the cost so far. `phi` is a further small rotation after A.
struct TimeOffset::Solution {
  Axes axes{};
  double shift_s{};
  double cost{std::numeric_limits<double>::infinity()};
  Eigen::Matrix3d A{Eigen::Matrix3d::Identity()};
  Eigen::Vector3d phi{Eigen::Vector3d::Zero()};
  Eigen::Matrix<double, 7, 7> information{Matrix7d::Zero()};  ///< By the turns alone.
  Eigen::Matrix<double, 7, 1> prior{Vector7d::Zero()};        ///< 1/sigma².
};

TimeOffset::TimeOffset(const CameraModel& camera, const Eigen::Quaterniond& q_BV,
                       double corner_noise_px, std::size_t most_turns)
    : camera_(camera), q_BV_(q_BV), corner_noise_px_(corner_noise_px), most_turns_(most_turns) {
  turns_.reserve(most_turns);
  work_.reserve(most_turns);
  sorted_.reserve(most_turns);
}

bool TimeOffset::take(const TagObservations& seen) {
  const Instant stamp = seen.exposed_at - seen.clock_shift;
  if (images_taken_ > 0) {
    const Instant last = image(images_taken_ - 1).at;
    if (stamp >= last && stamp - last < kImagePeriod) return false;
    if (stamp < last) images_taken_ = images_paired_ = 0;
  }
  image(images_taken_++).take(seen);
  return true;
}

std::size_t TimeOffset::first_to_pair() const {
  constexpr std::size_t kSpan = kLongest / kImagePeriod + 1;
  return images_taken_ > kImages ? images_taken_ - kImages + kSpan : 0;
}

void TimeOffset::keep(const TagObservations& seen) {
  (void)take(seen);
  images_paired_ = first_to_pair();
  turns_.clear();
}

void TimeOffset::forget_all() {
  images_taken_ = images_paired_ = 0;
  turns_.clear();
}

std::size_t TimeOffset::add(const TagObservations& seen, const GyroIntegral& gyro) {
  if (!take(seen)) return 0;
  const Instant stamp = image(images_taken_ - 1).at;
  images_paired_ = std::max(images_paired_, first_to_pair());
  std::size_t added = 0;
  for (; images_paired_ < images_taken_; ++images_paired_) {
    const Instant needed = image(images_paired_).at + from_seconds(kReach_s);
    // By stamps first, so that a replay with another order of arrival gives the same.
    if (needed + kOnTheWay > stamp || needed > gyro.end()) break;
    added += pair(images_paired_, gyro) ? 1 : 0;
  }
  return added;
}

bool TimeOffset::pair(std::size_t number, const GyroIntegral& gyro) {
  ImageAttitudes& now = image(number);
  const std::size_t oldest = images_taken_ > kImages ? images_taken_ - kImages : 0;
  ImageAttitudes* before = nullptr;
  for (std::size_t i = number; i > oldest && now.at - image(i - 1).at <= kLongest; --i) {
    ImageAttitudes& other = image(i - 1);
    if (other.count == 0 || now.at - other.at < kShortest) continue;
    if (before == nullptr || now.at - other.at <= kBest) before = &other;
  }
  const Duration reach = from_seconds(kReach_s);
  if (before == nullptr || now.count == 0 || !gyro.covers(before->at - reach, now.at + reach))
    return false;
  Turn turn;
  double largest_rad = 0;
  for (std::size_t lag = 0; lag < kLags; ++lag) {
    const Duration shift = from_seconds(static_cast<double>(lag) * kStep_s - kReach_s);
    const Eigen::Vector3d turned = gyro.turn(before->at + shift, now.at + shift);
    largest_rad = std::max(largest_rad, turned.norm());
    turn.gyro[lag] = turned.cast<float>();
  }
  if (largest_rad < kSmallestTurn_rad) return false;
  turn.gyro_degrees = gyro.turn(before->at, now.at, kDegree);
  before->solve(camera_, corner_noise_px_);
  now.solve(camera_, corner_noise_px_);
  const auto seen = turn_between(*before, now);
  if (!seen) return false;
  const Eigen::Matrix3d R_BV = q_BV_.toRotationMatrix();
  turn.camera = R_BV * seen->turn_V;
  turn.span_s = to_seconds(now.at - before->at);
  const Eigen::Matrix3d covariance = R_BV * seen->covariance * R_BV.transpose() +
                                     kOther_rad * kOther_rad * Eigen::Matrix3d::Identity();
  turn.weight = covariance.llt().solve(Eigen::Matrix3d::Identity());
  if (turns_.size() == most_turns_) turns_.erase(turns_.begin());
  turns_.push_back(turn);
  return true;
}

Eigen::Vector3d TimeOffset::Turn::gyro_at(double shift_s) const {
  const double place =
      std::clamp((shift_s + kReach_s) / kStep_s, 0.0, static_cast<double>(kLags - 1));
  const auto before = std::min(static_cast<std::size_t>(place), kLags - 2);
  const double share = place - static_cast<double>(before);
  return (1 - share) * gyro[before].cast<double>() + share * gyro[before + 1].cast<double>();
}

void TimeOffset::load(std::span<const Turn> turns, double shift_s) const {
  work_.resize(turns.size());
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const Turn& turn = turns[i];
    Residual& at = work_[i];
    at.gyro = turn.gyro_at(shift_s);
    at.rate = (turn.gyro_at(shift_s + kStep_s) - turn.gyro_at(shift_s - kStep_s)) / (2 * kStep_s);
    at.camera = turn.camera;
    at.weight = turn.weight;
    at.span_s = turn.span_s;
  }
}

/// Rotation or reflection that fits best (Kabsch), reweighted. The turns in `work_` then have it.
void TimeOffset::turn_axes(Solution& at, double determinant) const {
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    for (const Residual& one : work_) {
      const double square =
          round == 0 ? kNu : (one.gyro - at.A * one.camera).squaredNorm() * one.weight.trace() / 3;
      H += one.weight.trace() / (kNu + square) * one.gyro * one.camera.transpose();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign =
        (svd.matrixU() * svd.matrixV().transpose()).determinant() * determinant < 0 ? -1 : 1;
    at.A = svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  }
  for (Residual& one : work_) {
    one.camera = at.A * one.camera;
    one.weight = (at.A * one.weight * at.A.transpose()).eval();
  }
}

/// Iteratively reweighted least squares over axes, bias and, if it is free, the shift.
void TimeOffset::solve(Solution& at, const ClockPrior* free_shift) const {
  at.prior = priors(at.axes);
  Vector7d from_prior = Vector7d::Zero();
  if (free_shift != nullptr) {
    at.prior(kShift) = 1 / (free_shift->sigma_s * free_shift->sigma_s);
    from_prior(kShift) = at.shift_s - free_shift->shift_s;
  }
  const double start_s = at.shift_s;
  Vector7d x = Vector7d::Zero();
  for (int round = 0;; ++round) {
    const Vector7d off = x + from_prior;
    at.cost = off.dot(at.prior.cwiseProduct(off));
    if (at.axes != Axes::kConfigured) at.cost += kAnyRotation;
    at.information.setZero();
    Vector7d b = -at.prior.cwiseProduct(off);
    for (Residual& one : work_) {
      one.r = one.gyro + x(kShift) * one.rate - one.span_s * x.segment<3>(kBias) - one.camera -
              x.segment<3>(kPhi).cross(one.camera);
      const Eigen::Vector3d weighted = one.weight * one.r;
      one.square = one.r.dot(weighted);
      at.cost += (kNu + 3) * std::log1p(one.square / kNu);
      Eigen::Matrix<double, 3, 7> H;  // ∂r
      H << skew(one.camera), -one.span_s * Eigen::Matrix3d::Identity(), one.rate;
      const double weight = (kNu + 3) / (kNu + one.square);
      at.information.noalias() += H.transpose() * (weight * one.weight) * H;
      b.noalias() -= weight * H.transpose() * weighted;
    }
    at.phi = x.segment<3>(kPhi);
    if (round == kRounds) return;
    Matrix7d all = at.information;
    all.diagonal() += at.prior;
    if (free_shift == nullptr) {
      x.head<6>() += all.topLeftCorner<6, 6>().ldlt().solve(b.head<6>());
    } else {
      x += all.ldlt().solve(b);
      x(kShift) = std::clamp(x(kShift), -kStep_s, kStep_s);
      at.shift_s = start_s + x(kShift);
    }
  }
}

TimeOffset::Solution TimeOffset::solve_at(std::span<const Turn> turns, Axes axes,
                                          double shift_s) const {
  Solution at{.axes = axes, .shift_s = shift_s};
  load(turns, shift_s);
  if (axes != Axes::kConfigured) turn_axes(at, axes == Axes::kReflected ? -1 : 1);
  return at;
}

OffsetFit TimeOffset::conclude(const Solution& at) const {
  const auto median = [&](auto value) {
    sorted_.clear();
    for (const Residual& one : work_) sorted_.push_back(value(one));
    return nth_smallest(sorted_, sorted_.size() / 2);
  };
  OffsetFit fit;
  fit.shift_s = at.shift_s;
  fit.cost = at.cost;
  fit.A = exp_so3(at.phi).toRotationMatrix() * at.A;
  fit.misfit = median([](const Residual& one) { return one.square; }) / kMedian3;
  const double motion = median([](const Residual& one) { return one.gyro.squaredNorm(); });
  fit.unexplained = median([](const Residual& one) { return one.r.squaredNorm(); }) /
                    std::max(motion, kSmallestTurn_rad * kSmallestTurn_rad);
  const Eigen::Matrix3d axes = at.information.block<3, 3>(kPhi, kPhi);
  const double least =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(axes, Eigen::EigenvaluesOnly).eigenvalues()(0);
  fit.axes_sigma_rad = 1 / std::sqrt(std::max(least, 1e-12));
  Matrix7d all = at.information;
  all.diagonal() += at.prior;
  const Eigen::Matrix<double, 6, 1> mixed = all.topRightCorner<6, 1>();
  const double by_shift =
      all(kShift, kShift) - mixed.dot(all.topLeftCorner<6, 6>().ldlt().solve(mixed));
  fit.shift_sigma_s = 1 / std::sqrt(std::max(by_shift, 1e-12));
  return fit;
}

OffsetFit TimeOffset::fit(Axes axes, const ClockPrior& prior, std::size_t newest) const {
  const auto turns = std::span(turns_).last(std::min(newest, turns_.size()));
  const double reach_s = std::min(kReach_sigma * prior.sigma_s, 2 * kReach_s);
  std::array<double, kLags> costs;
  costs.fill(std::numeric_limits<double>::infinity());
  for (std::size_t lag = 0; lag < kLags && !turns.empty(); ++lag) {
    const double shift_s = static_cast<double>(lag) * kStep_s - kReach_s;
    const double off_s = shift_s - prior.shift_s;
    if (std::abs(off_s) > std::max(reach_s, kStep_s)) continue;
    Solution at = solve_at(turns, axes, shift_s);
    solve(at, nullptr);
    costs[lag] = at.cost + std::pow(off_s / prior.sigma_s, 2);
  }
  const auto best = static_cast<std::size_t>(std::ranges::min_element(costs) - costs.begin());
  if (!std::isfinite(costs[best])) return {.shift_sigma_s = kReach_s, .unexplained = 1};
  Solution at = solve_at(turns, axes, static_cast<double>(best) * kStep_s - kReach_s);
  solve(at, &prior);
  OffsetFit fit = conclude(at);
  for (std::size_t lag = 0; lag < kLags; ++lag) {
    const double beside_s = std::abs(static_cast<double>(lag) * kStep_s - kReach_s - fit.shift_s);
    if (beside_s > kOther_s && costs[lag] < fit.cost + kOffsetEvidence) fit.is_unique = false;
  }
  return fit;
}

OffsetFit TimeOffset::fit_degrees(double shift_s, std::size_t newest) const {
  const auto turns = std::span(turns_).last(std::min(newest, turns_.size()));
  Solution at = solve_at(turns, Axes::kConfigured, shift_s);
  for (std::size_t i = 0; i < turns.size(); ++i) work_[i].gyro = turns[i].gyro_degrees;
  solve(at, nullptr);
  OffsetFit fit = conclude(at);
  // At another clock a resting camera fits a gyroscope that turns by a 57th.
  sorted_.clear();
  for (const Turn& turn : turns) sorted_.push_back(turn.camera.norm());
  if (nth_smallest(sorted_, sorted_.size() / 2) < kSmallestTurn_rad) fit.unexplained = 1;
  return fit;
}

}  // namespace fiducap
