#include "calibration/imu/imu_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <Eigen/Dense>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "estimation/filter/chi_square.hpp"

namespace fiducap {
namespace {

constexpr double kPointsPerOctave = 4;
constexpr std::size_t kMinAverages = 9;
constexpr double kFlicker = 2 * std::numbers::ln2 / std::numbers::pi;
constexpr double kSeen_sigma = 3;  // smallest significance of a walk
constexpr double kBoundQuantile = 0.05;

using Parts = Eigen::Vector3d;  // N², B², K²

Parts shape(double tau_s) { return {1 / tau_s, kFlicker, tau_s / 3}; }

struct PartsFit {
  Parts parts{Parts::Zero()};
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Zero()};
  double cost{std::numeric_limits<double>::infinity()};
};

/// Weighted least squares with a subset of the parts; `cost` infinite when a part is negative.
PartsFit fit_subset(std::span<const AllanPoint> points, std::span<const double> weights,
                    unsigned subset) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Parts h = shape(points[i].tau_s);
    A += weights[i] * h * h.transpose();
    b += weights[i] * points[i].deviation * points[i].deviation * h;
  }
  for (int k = 0; k < 3; ++k) {
    if ((subset >> k & 1U) != 0) continue;
    A.row(k).setZero();
    A.col(k).setZero();
    A(k, k) = 1;
    b(k) = 0;
  }
  // Scaled: the parts differ by many powers of ten.
  const Eigen::Vector3d scale = A.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Matrix3d inverse =
      scale.asDiagonal() * Eigen::Matrix3d(scale.asDiagonal() * A * scale.asDiagonal()).inverse() *
      scale.asDiagonal();
  PartsFit fit{inverse * b, inverse, 0};
  for (int k = 0; k < 3; ++k)
    if ((subset >> k & 1U) == 0) fit.parts(k) = 0;
  if (fit.parts.minCoeff() < 0) return {};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double off =
        points[i].deviation * points[i].deviation - shape(points[i].tau_s).dot(fit.parts);
    fit.cost += weights[i] * off * off;
  }
  return fit;
}

PartsFit fit_parts(std::span<const AllanPoint> points, std::span<const double> weights) {
  PartsFit best;
  for (unsigned subset = 1; subset < 8; ++subset) {
    const PartsFit fit = fit_subset(points, weights, subset);
    if (fit.cost < best.cost) best = fit;
  }
  return best;
}

constexpr double kShared = 1 / kPointsPerOctave;

/// var(σ̂²) = σ⁴ (2 / freedom + model²). Neighbours on the plot share their data and their weight.
/// @param model  relative error of the three-part model (filters, vibration)
double weight_of(const AllanPoint& point, double variance, double model) {
  return kShared / ((2 / point.freedom + model * model) * variance * variance);
}

/// Weights by the fitted curve: by the points themselves, low ones would bias it.
PartsFit fit_with(std::span<const AllanPoint> points, double model) {
  std::vector<double> weights(points.size());
  PartsFit fit;
  for (int round = 0; round <= 5; ++round) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double square = round == 0 ? points[i].deviation * points[i].deviation
                                       : shape(points[i].tau_s).dot(fit.parts);
      weights[i] = weight_of(points[i], square + 1e-300, model);
    }
    fit = fit_parts(points, weights);
  }
  return fit;
}

/// Increases the model error until the cost is as expected: where the model does not hold, the
/// precise shortest averages would dominate the fit.
PartsFit fit_with_model_error(std::span<const AllanPoint> points) {
  // Expected are `kShared` per point.
  const double usual = 2 * kShared * static_cast<double>(points.size());
  constexpr double kLargest = 0.5;
  PartsFit fit = fit_with(points, 0);
  for (double model = 0.01; fit.cost > usual && model < kLargest; model *= 1.3)
    fit = fit_with(points, model);
  return fit;
}

double root(double square) { return std::sqrt(std::max(0.0, square)); }

/// Upper bound of a walk that is not seen, from the last point of the plot.
double upper_bound(const AllanPoint& last) {
  const int freedom = std::max(1, static_cast<int>(last.freedom));
  const double most =
      last.deviation * last.deviation * last.freedom / chi_square_quantile(freedom, kBoundQuantile);
  return std::sqrt(3 * most / last.tau_s);
}

constexpr double kMinDuration_s = 60;  // white noise to about one percent at 200 Hz
constexpr double kMaxLost = 0.01;
constexpr double kWindow_s = 1;
constexpr double kStillRate_rad_s = 0.01;  // below: attributed to the bias
constexpr double kStillForce_m_s2 = 0.05;
constexpr double kShaking = 4;  // times the usual spread inside a window

double component(const ImuSample& sample, std::size_t axis) {
  const auto k = static_cast<Eigen::Index>(axis % 3);
  return axis < 3 ? sample.w_WB_B(k) : sample.f_B(k);
}

double median(std::vector<double> values) { return nth_smallest(values, values.size() / 2); }

/// Begin of the first window in which this axis moved, s.
std::optional<double> moved_at(std::span<const double> values, std::size_t length, double allowed) {
  const auto count = static_cast<double>(length);
  std::vector<double> means;
  std::vector<double> spreads;
  for (std::size_t at = 0; at + length <= values.size(); at += length) {
    double mean = 0;
    double squares = 0;
    for (const double v : values.subspan(at, length)) mean += v / count;
    for (const double v : values.subspan(at, length)) squares += (v - mean) * (v - mean);
    means.push_back(mean);
    spreads.push_back(std::sqrt(squares / count));
  }
  const double usual = median(means);
  const double usual_spread = median(spreads);
  const double limit = allowed + 6 * usual_spread / std::sqrt(count);  // noise of a window's mean
  for (std::size_t i = 0; i < means.size(); ++i) {
    const bool turned = std::abs(means[i] - usual) > limit;
    const bool shaken = spreads[i] > kShaking * usual_spread && spreads[i] > allowed;
    if (turned || shaken) return static_cast<double>(i) * kWindow_s;
  }
  return std::nullopt;
}

/// Duration, rate and gaps.
Expected<StaticImuNoise> check_stamps(std::span<const ImuSample> samples,
                                      const std::string& context) {
  StaticImuNoise result;
  result.samples = static_cast<long>(samples.size());
  if (samples.size() > 1)
    result.seconds = to_seconds(samples.back().sampled_at - samples.front().sampled_at);
  if (result.seconds < kMinDuration_s)
    return fail(ErrorCode::kInvalid,
                "has " + fixed(result.seconds, 1) +
                    " s of IMU samples; at least 60 s are needed, 10 minutes or more are good",
                context);
  std::vector<double> steps;
  for (std::size_t i = 1; i < samples.size(); ++i)
    steps.push_back(to_seconds(samples[i].sampled_at - samples[i - 1].sampled_at));
  const double step = median(steps);
  if (!(step > 0)) return fail(ErrorCode::kInvalid, "has IMU stamps that do not increase", context);
  for (const double s : steps) result.lost += std::max(0L, std::lround(s / step) - 1);
  result.rate_hz = static_cast<double>(result.samples - 1 + result.lost) / result.seconds;
  if (static_cast<double>(result.lost) > kMaxLost * static_cast<double>(result.samples))
    return fail(ErrorCode::kInvalid,
                std::to_string(result.lost) + " of " +
                    std::to_string(result.samples + result.lost) +
                    " IMU samples are missing; Allan deviations need a constant rate",
                context);
  return result;
}

/// RMS of the axes that show a walk, or the largest of their bounds.
double walk_of(std::span<const AxisNoise> axes, bool& seen) {
  double squares = 0;
  double bound = 0;
  int shown = 0;
  for (const AxisNoise& axis : axes) {
    bound = std::max(bound, axis.walk_bound);
    if (!axis.walk_seen) continue;
    ++shown;
    squares += axis.walk * axis.walk;
  }
  seen = shown > 0;
  return seen ? std::sqrt(squares / shown) : bound;
}

double white_of(std::span<const AxisNoise> axes) {
  double squares = 0;
  for (const AxisNoise& axis : axes) squares += axis.white * axis.white / 3;
  return std::sqrt(squares);
}

}  // namespace

std::vector<AllanPoint> allan_deviation(std::span<const double> values, double rate_hz) {
  const std::size_t n = values.size();
  if (n < 2 * kMinAverages) return {};
  double mean = 0;
  for (const double value : values) mean += value / static_cast<double>(n);
  std::vector<double> sum(n + 1, 0.0);  // without the mean, for precision
  for (std::size_t i = 0; i < n; ++i) sum[i + 1] = sum[i] + (values[i] - mean);
  std::vector<AllanPoint> points;
  std::size_t last = 0;
  for (double exact = 1; exact * kMinAverages <= static_cast<double>(n);
       exact *= std::exp2(1 / kPointsPerOctave)) {
    const auto m = static_cast<std::size_t>(exact);
    if (m == last) continue;
    last = m;
    double squares = 0;
    const std::size_t terms = n - 2 * m + 1;
    for (std::size_t k = 0; k < terms; ++k) {
      const double second = sum[k + 2 * m] - 2 * sum[k + m] + sum[k];
      squares += second * second;
    }
    const double averages = static_cast<double>(m);
    const double variance = squares / (2 * averages * averages * static_cast<double>(terms));
    // White noise: 1.5 per independent pair of averages, all of them at m = 1 (IEEE 1139, annex).
    const double pairs = static_cast<double>(n) / averages;
    points.push_back({averages / rate_hz, std::sqrt(variance),
                      std::max(1.0, 1.5 * (pairs - 2) * (m > 1 ? 1.0 : 4.0 / 9))});
  }
  return points;
}

AxisNoise fit_noise(std::span<const AllanPoint> points) {
  FIDUCAP_ASSERT(points.size() >= 4);
  const PartsFit fit = fit_with_model_error(points);
  AxisNoise noise;
  noise.white = root(fit.parts(0));
  noise.flicker = root(fit.parts(1));
  noise.walk = root(fit.parts(2));
  if (noise.white > 0) noise.white_sigma = root(fit.covariance(0, 0)) / (2 * noise.white);
  if (noise.walk > 0) noise.walk_sigma = root(fit.covariance(2, 2)) / (2 * noise.walk);
  noise.walk_seen = fit.parts(2) > kSeen_sigma * root(fit.covariance(2, 2));
  noise.walk_bound = upper_bound(points.back());
  return noise;
}

double AxisNoise::deviation(double tau_s) const {
  return root(shape(tau_s).dot(Parts(white * white, flicker * flicker, walk * walk)));
}

double AxisNoise::seconds_to_see(double walk_density) const {
  // At τ = 3 N/K the walk has three times the variance of the white noise. Fifty averages of that
  // length determine it to a third in 95 of 100 recordings.
  return 50 * 3 * white / walk_density;
}

Expected<StaticImuNoise> identify_static_imu(std::span<const ImuSample> samples,
                                             const std::string& context) {
  auto result = check_stamps(samples, context);
  if (!result) return result;
  const auto window =
      static_cast<std::size_t>(std::max(1L, std::lround(kWindow_s * result->rate_hz)));
  std::vector<double> values(samples.size());
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    for (std::size_t i = 0; i < samples.size(); ++i) values[i] = component(samples[i], axis);
    if (const auto moved = moved_at(values, window, axis < 3 ? kStillRate_rad_s : kStillForce_m_s2))
      return fail(ErrorCode::kInvalid,
                  "the IMU did not lie still: " + std::string(axis < 3 ? "gyro" : "accelerometer") +
                      " " + "xyz"[axis % 3] + " moved " + fixed(*moved, 0) +
                      " s after the start; record it on a table and do not touch it",
                  context);
    result->plot[axis] = allan_deviation(values, result->rate_hz);
    result->axes[axis] = fit_noise(result->plot[axis]);
    if (!(result->axes[axis].white > 0))
      return fail(ErrorCode::kInvalid,
                  "shows no white noise: are the samples filtered or constant?", context);
  }
  const std::span<const AxisNoise> axes(result->axes);
  result->noise.rate_hz = result->rate_hz;
  result->noise.gyro_noise_rad_s_rtHz = white_of(axes.first(3));
  result->noise.accel_noise_m_s2_rtHz = white_of(axes.last(3));
  result->noise.gyro_walk_rad_s2_rtHz = walk_of(axes.first(3), result->gyro_walk_seen);
  result->noise.accel_walk_m_s3_rtHz = walk_of(axes.last(3), result->accel_walk_seen);
  return result;
}

}  // namespace fiducap
