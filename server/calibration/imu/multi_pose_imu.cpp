#include "calibration/imu/imu_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <ceres/ceres.h>
#include <Eigen/Eigenvalues>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "base/text.hpp"

namespace fiducap {
namespace {

constexpr int kMinRests = 12;  // nine parameters of the accelerometer, and redundancy
constexpr double kMinRest_s = 1;
constexpr double kFirstRest_s = 3;  // at the start; gives the scatter at rest
constexpr double kMinTurn_rad = 5 * std::numbers::pi / 180;
constexpr double kMaxScaleSigma = 0.01;
constexpr double kMinSpread = 0.05;  // of the verticals: smallest eigenvalue, 1/3 is uniform

using Accel = std::array<double, 9>;  // upper triangle row by row, then bias
using Gyro = std::array<double, 9>;   // row by row

Eigen::Matrix3d matrix_of(const Accel& a) {
  Eigen::Matrix3d M;
  M << a[0], a[1], a[2], 0, a[3], a[4], 0, 0, a[5];
  return M;
}

Eigen::Vector3d bias_of(const Accel& a) { return {a[6], a[7], a[8]}; }

Eigen::Matrix3d matrix_of_gyro(const Gyro& g) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(g.data());
}

/// Scatter of the accelerometer within a second around each sample: standard deviation, root of the
/// sum of squares of the axes, m/s².
std::vector<double> scatter_of_accel(std::span<const ImuSample> samples,
                                     std::size_t samples_per_second) {
  const std::size_t half = std::max<std::size_t>(1, samples_per_second / 2);
  std::vector<Eigen::Vector3d> sum(samples.size() + 1, Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> squares(samples.size() + 1, Eigen::Vector3d::Zero());
  // Relative to the first reading, for precision.
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector3d f = samples[i].f_B - samples.front().f_B;
    sum[i + 1] = sum[i] + f;
    squares[i + 1] = squares[i] + f.cwiseAbs2();
  }
  std::vector<double> scatter(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::size_t from = i > half ? i - half : 0;
    const std::size_t to = std::min(samples.size(), i + half + 1);
    const auto count = static_cast<double>(to - from);
    const Eigen::Vector3d mean = (sum[to] - sum[from]) / count;
    const Eigen::Vector3d variance = (squares[to] - squares[from]) / count - mean.cwiseAbs2();
    scatter[i] = std::sqrt(std::max(0.0, variance.sum()));
  }
  return scatter;
}

/// Samples [begin, end) at rest, and their means.
struct Rest {
  std::size_t begin;
  std::size_t end;
  Eigen::Vector3d f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d w{Eigen::Vector3d::Zero()};

  Rest(std::span<const ImuSample> samples, std::size_t first, std::size_t last)
      : begin(first), end(last) {
    const auto count = static_cast<double>(end - begin);
    for (const ImuSample& s : samples.subspan(begin, end - begin)) {
      f += s.f_B / count;
      w += s.w_WB_B / count;
    }
  }
};

/// Rests of at least `least` samples with the scatter below `limit`, without a quarter of a second
/// at both ends.
std::vector<Rest> find_rests(std::span<const ImuSample> samples, std::span<const double> scatter,
                             double limit, std::size_t samples_per_second, std::size_t least) {
  const std::size_t margin = samples_per_second / 4;
  std::vector<Rest> rests;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= scatter.size(); ++i) {
    if (i < scatter.size() && scatter[i] < limit) continue;
    if (i >= begin + least + 2 * margin) rests.emplace_back(samples, begin + margin, i - margin);
    begin = i + 1;
  }
  return rests;
}

struct GravityCost {
  Eigen::Vector3d f;
  double gravity;

  template <typename T>
  bool operator()(const T* a, T* residual) const {
    const T x = T(f.x()) - a[6], y = T(f.y()) - a[7], z = T(f.z()) - a[8];
    const T u = a[0] * x + a[1] * y + a[2] * z;
    const T v = a[3] * y + a[4] * z;
    const T w = a[5] * z;
    using std::sqrt;
    residual[0] = sqrt(u * u + v * v + w * w) - T(gravity);
    return true;
  }
};

/// The vertical, propagated by the gyroscope from one rest to the next.
struct Turn {
  Eigen::Vector3d up_before;
  Eigen::Vector3d up_after;
  std::vector<Eigen::Vector3d> steps;  ///< Rate without bias, times time.

  [[nodiscard]] Eigen::Vector3d propagated(const Eigen::Matrix3d& M) const {
    Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
    for (const Eigen::Vector3d& step : steps) q = exp_so3(-(M * step)) * q;
    return q.normalized() * up_before;
  }
};

struct TurnCost {
  const Turn* turn;

  bool operator()(const double* g, double* residual) const {
    Gyro numbers{};
    std::copy_n(g, 9, numbers.begin());
    const Eigen::Vector3d off = turn->propagated(matrix_of_gyro(numbers)) - turn->up_after;
    std::copy_n(off.data(), 3, residual);
    return true;
  }
};

ceres::Solver::Options quiet_solver() {
  ceres::Solver::Options settings;
  settings.linear_solver_type = ceres::DENSE_QR;
  settings.max_num_iterations = 200;
  settings.function_tolerance = 1e-14;
  settings.parameter_tolerance = 1e-12;
  settings.logging_type = ceres::SILENT;
  return settings;
}

/// @param sigma  out, scaled by the residuals
/// @return false for a singular problem
bool solve(ceres::Problem& problem, double* numbers, std::array<double, 9>& sigma) {
  ceres::Solver::Summary summary;
  ceres::Solve(quiet_solver(), &problem, &summary);
  ceres::Covariance covariance({});
  const std::vector<const double*> blocks{numbers};
  if (!summary.IsSolutionUsable() || !covariance.Compute(blocks, &problem)) return false;
  std::array<double, 81> values{};
  covariance.GetCovarianceBlock(numbers, numbers, values.data());
  const double freedom = std::max(1, problem.NumResiduals() - 9);
  for (std::size_t i = 0; i < 9; ++i)
    sigma[i] = std::sqrt(values[10 * i] * 2 * summary.final_cost / freedom);
  return true;
}

struct AccelFit {
  std::vector<Rest> rests;
  Accel numbers{1, 0, 0, 1, 0, 1, 0, 0, 0};
  std::array<double, 9> sigma{};
  double rms{};
};

double gravity_rms(const std::vector<Rest>& rests, const Accel& numbers, double gravity) {
  double sum = 0;
  for (const Rest& rest : rests)
    sum += std::pow((matrix_of(numbers) * (rest.f - bias_of(numbers))).norm() - gravity, 2);
  return std::sqrt(sum / static_cast<double>(rests.size()));
}

std::optional<AccelFit> fit_accel(std::vector<Rest> rests, double gravity) {
  AccelFit fit;
  fit.rests = std::move(rests);
  ceres::Problem problem;
  for (const Rest& rest : fit.rests)
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<GravityCost, 1, 9>(new GravityCost{rest.f, gravity}),
        nullptr, fit.numbers.data());
  if (!solve(problem, fit.numbers.data(), fit.sigma)) return std::nullopt;
  fit.rms = gravity_rms(fit.rests, fit.numbers, gravity);
  return fit;
}

/// The fit with the threshold of scatter that gives the smallest residuals.
std::optional<AccelFit> best_accel(std::span<const ImuSample> samples,
                                   std::size_t samples_per_second, double gravity, int& most) {
  const std::vector<double> scatter = scatter_of_accel(samples, samples_per_second);
  const auto rate = static_cast<double>(samples_per_second);
  const auto first = static_cast<std::size_t>(kFirstRest_s * rate);
  const auto least = static_cast<std::size_t>(kMinRest_s * rate);
  std::vector<double> start = scatter;
  start.resize(std::min(start.size(), first));
  const double usual = nth_smallest(start, start.size() / 2);
  std::optional<AccelFit> best;
  for (double factor = 1.5; factor < 12; factor *= 1.25) {
    auto rests = find_rests(samples, scatter, factor * usual, samples_per_second, least);
    most = std::max(most, static_cast<int>(rests.size()));
    if (static_cast<int>(rests.size()) < kMinRests) continue;
    auto fit = fit_accel(std::move(rests), gravity);
    if (fit && (!best || fit->rms < best->rms)) best = std::move(fit);
  }
  return best;
}

std::vector<Turn> turns_of(std::span<const ImuSample> samples, const AccelFit& accel) {
  const auto up = [&](const Rest& rest) {
    return (matrix_of(accel.numbers) * (rest.f - bias_of(accel.numbers))).normalized();
  };
  std::vector<Turn> turns;
  for (std::size_t k = 1; k < accel.rests.size(); ++k) {
    const Rest& a = accel.rests[k - 1];
    const Rest& b = accel.rests[k];
    Turn turn{up(a), up(b), {}};
    if (std::acos(std::clamp(turn.up_before.dot(turn.up_after), -1.0, 1.0)) < kMinTurn_rad)
      continue;
    for (std::size_t i = a.end; i <= b.begin; ++i) {
      const double dt = to_seconds(samples[i].sampled_at - samples[i - 1].sampled_at);
      const Eigen::Vector3d w = (samples[i].w_WB_B + samples[i - 1].w_WB_B) / 2;
      turn.steps.emplace_back((w - (a.w + b.w) / 2) * dt);
    }
    turns.push_back(std::move(turn));
  }
  return turns;
}

double up_rms(const std::vector<Turn>& turns, const Eigen::Matrix3d& M) {
  double sum = 0;
  for (const Turn& turn : turns) sum += (turn.propagated(M) - turn.up_after).squaredNorm();
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, turns.size())));
}

struct GyroFit {
  Gyro numbers{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 9> sigma{};
};

std::optional<GyroFit> fit_gyro(const std::vector<Turn>& turns) {
  GyroFit fit;
  ceres::Problem problem;
  for (const Turn& turn : turns)
    problem.AddResidualBlock(
        new ceres::NumericDiffCostFunction<TurnCost, ceres::CENTRAL, 3, 9>(new TurnCost{&turn}),
        nullptr, fit.numbers.data());
  if (!solve(problem, fit.numbers.data(), fit.sigma)) return std::nullopt;
  return fit;
}

double spread_of(const std::vector<Rest>& rests) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const Rest& rest : rests)
    sum +=
        rest.f.normalized() * rest.f.normalized().transpose() / static_cast<double>(rests.size());
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(sum).eigenvalues()(0);
}

const char* const kHowTo =
    ": let it lie for some seconds, then put it down in 20 to 40 attitudes, on all sides and "
    "edges, two seconds each, rotating it by hand between them";

std::size_t samples_per_second(std::span<const ImuSample> samples) {
  const double seconds = to_seconds(samples.back().sampled_at - samples.front().sampled_at);
  if (!(seconds > 0)) return 0;
  return static_cast<std::size_t>(std::lround(static_cast<double>(samples.size() - 1) / seconds));
}

Eigen::Vector3d mean_gyro(const std::vector<Rest>& rests) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Rest& rest : rests) mean += rest.w / static_cast<double>(rests.size());
  return mean;
}

MultiPoseImu result_of(const AccelFit& accel, const GyroFit& gyro, const std::vector<Turn>& turns,
                       double gravity) {
  MultiPoseImu out;
  out.correction.accel_matrix = matrix_of(accel.numbers);
  out.correction.accel_bias_m_s2 = bias_of(accel.numbers);
  out.correction.gyro_matrix = matrix_of_gyro(gyro.numbers);
  out.correction.gyro_bias_rad_s = mean_gyro(accel.rests);
  out.accel_scale_sigma = {accel.sigma[0], accel.sigma[3], accel.sigma[5]};
  out.accel_bias_sigma_m_s2 = {accel.sigma[6], accel.sigma[7], accel.sigma[8]};
  out.gyro_scale_sigma = {gyro.sigma[0], gyro.sigma[4], gyro.sigma[8]};
  out.rests = static_cast<int>(accel.rests.size());
  out.turns = static_cast<int>(turns.size());
  out.gravity_rms_before = gravity_rms(accel.rests, AccelFit{}.numbers, gravity);
  out.gravity_rms_after = accel.rms;
  out.up_rms_before = up_rms(turns, Eigen::Matrix3d::Identity());
  out.up_rms_after = up_rms(turns, out.correction.gyro_matrix);
  return out;
}

}  // namespace

Expected<MultiPoseImu> calibrate_multi_pose(std::span<const ImuSample> samples, double gravity_m_s2,
                                            const std::string& context) {
  constexpr std::size_t kMinSamples = 100;
  const std::size_t rate = samples.size() < kMinSamples ? 0 : samples_per_second(samples);
  if (rate < 10)
    return fail(ErrorCode::kInvalid, "has too few IMU samples: at least 10 per second are needed",
                context);
  int most = 0;
  const auto accel = best_accel(samples, rate, gravity_m_s2, most);
  if (!accel)
    return fail(ErrorCode::kInvalid,
                "shows the IMU at rest in " + std::to_string(most) + " places, at least " +
                    std::to_string(kMinRests) + " are needed" + kHowTo,
                context);
  const double worst = std::max({accel->sigma[0], accel->sigma[3], accel->sigma[5]});
  if (spread_of(accel->rests) < kMinSpread || !(worst < kMaxScaleSigma))
    return fail(ErrorCode::kInvalid,
                "the attitudes are too similar: the accelerometer's scale would have a sigma of " +
                    fixed(100 * worst, 1) + " %" + kHowTo,
                context);
  const std::vector<Turn> turns = turns_of(samples, *accel);
  const auto gyro = static_cast<int>(turns.size()) < kMinRests - 1 ? std::nullopt : fit_gyro(turns);
  const double worst_gyro =
      gyro ? std::max({gyro->sigma[0], gyro->sigma[4], gyro->sigma[8]}) : kMaxScaleSigma;
  if (!(worst_gyro < kMaxScaleSigma))
    return fail(ErrorCode::kInvalid,
                "the rotations between the rests do not determine the gyroscope's scale: rotate it "
                "about all three axes" +
                    std::string(kHowTo),
                context);
  MultiPoseImu out = result_of(*accel, *gyro, turns, gravity_m_s2);
  out.seconds = to_seconds(samples.back().sampled_at - samples.front().sampled_at);
  return out;
}

}  // namespace fiducap
