#include "calibration/imu/static_imu.hpp"

#include <algorithm>
#include <cmath>

#include "base/text.hpp"

namespace fiducap {
namespace {

constexpr double kShortest_s = 60;  // white noise to about one percent at 200 Hz
constexpr double kMostLost = 0.01;
constexpr double kWindow_s = 1;
constexpr double kStillRate_rad_s = 0.01;  // slower turning than this is the bias' own business
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

struct Window {
  double mean{};
  double spread{};
};

std::vector<Window> windows_of(std::span<const double> values, std::size_t length) {
  std::vector<Window> windows;
  for (std::size_t at = 0; at + length <= values.size(); at += length) {
    Window w;
    for (const double v : values.subspan(at, length)) w.mean += v / static_cast<double>(length);
    for (const double v : values.subspan(at, length)) w.spread += (v - w.mean) * (v - w.mean);
    w.spread = std::sqrt(w.spread / static_cast<double>(length));
    windows.push_back(w);
  }
  return windows;
}

/// First window, counted in seconds, in which this axis did not lie still.
std::optional<double> moved_at(std::span<const double> values, std::size_t length, double allowed) {
  const std::vector<Window> windows = windows_of(values, length);
  std::vector<double> means;
  std::vector<double> spreads;
  for (const Window& w : windows) {
    means.push_back(w.mean);
    spreads.push_back(w.spread);
  }
  const double usual = median(means);
  const double usual_spread = median(spreads);
  // The mean of a window scatters by itself.
  const double limit = allowed + 6 * usual_spread / std::sqrt(static_cast<double>(length));
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const bool turned = std::abs(windows[i].mean - usual) > limit;
    const bool shaken = windows[i].spread > kShaking * usual_spread && windows[i].spread > allowed;
    if (turned || shaken) return static_cast<double>(i) * kWindow_s;
  }
  return std::nullopt;
}

/// Length, rate, holes.
Expected<StaticImuNoise> look_at_stamps(std::span<const ImuSample> samples,
                                        const std::string& context) {
  StaticImuNoise result;
  result.samples = static_cast<long>(samples.size());
  if (samples.size() > 1)
    result.seconds = to_seconds(samples.back().sampled_at - samples.front().sampled_at);
  if (result.seconds < kShortest_s)
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
  if (static_cast<double>(result.lost) > kMostLost * static_cast<double>(result.samples))
    return fail(ErrorCode::kInvalid,
                std::to_string(result.lost) + " of " +
                    std::to_string(result.samples + result.lost) +
                    " IMU samples are missing; Allan deviations need an even rate",
                context);
  return result;
}

/// RMS of the axes that show a walk; when none does, the largest of their bounds.
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
  auto result = look_at_stamps(samples, context);
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
                      " s after the start; record it on a table that nobody touches",
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
