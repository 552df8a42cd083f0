#include "calibration/imu/rest_intervals.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

std::vector<double> scatter_of_accel(std::span<const ImuSample> samples,
                                     std::size_t samples_per_second) {
  const std::size_t half = std::max<std::size_t>(1, samples_per_second / 2);
  std::vector<Eigen::Vector3d> sum(samples.size() + 1, Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> squares(samples.size() + 1, Eigen::Vector3d::Zero());
  // Around the first reading: differences of large sums would lose digits.
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

std::vector<RestInterval> find_rests(std::span<const double> scatter, double limit,
                                     std::size_t samples_per_second, std::size_t least) {
  const std::size_t margin = samples_per_second / 4;
  std::vector<RestInterval> rests;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= scatter.size(); ++i) {
    if (i < scatter.size() && scatter[i] < limit) continue;
    if (i >= begin + least + 2 * margin) rests.push_back({begin + margin, i - margin});
    begin = i + 1;
  }
  return rests;
}

}  // namespace fiducap
