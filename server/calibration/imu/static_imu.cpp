#include "calibration/imu/imu_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/text.hpp"

namespace fiducap {
namespace {

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

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

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
