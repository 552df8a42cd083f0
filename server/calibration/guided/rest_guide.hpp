#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "calibration/imu/static_imu.hpp"
#include "capture/imu_sample.hpp"

namespace fiducap {

/// Waits until an IMU has lain still for long enough, and says so meanwhile.
class RestGuide final {
 public:
  /// A minute tells the white noise to a percent; the bound on the walk is that of a minute.
  static constexpr double kLongEnough_s = 62;

  void take(const ImuSample& sample);
  /// Of the time that is needed, 0 … 1.
  [[nodiscard]] double share() const;
  [[nodiscard]] std::string hint() const;
  [[nodiscard]] bool is_enough() const { return share() >= 1; }
  /// @return Error when it moved after all; begin() again then
  [[nodiscard]] Expected<StaticImuNoise> result() const;
  void begin();

 private:
  [[nodiscard]] bool has_moved(const ImuSample& sample) const;
  void take_mean(const ImuSample& sample);

  std::vector<ImuSample> samples_;
  Eigen::Vector3d mean_w_{Eigen::Vector3d::Zero()};  ///< Of the first second.
  Eigen::Vector3d mean_f_{Eigen::Vector3d::Zero()};
  int averaged_{0};
  bool moved_{false};  ///< And lies still again only since samples_.front().
};

}  // namespace fiducap
