#pragma once

#include <string>
#include <vector>

#include "base/config_check.hpp"

namespace fiducap::dds {

/// The sensors of a body as topics of ROS 2: any driver of a camera or an IMU.
struct RosSourceConfig {
  /// Per camera of the body, in their order. sensor_msgs/Image; CompressedImage when the name ends
  /// in `/compressed`.
  std::vector<std::string> images;
  std::string imu;  ///< sensor_msgs/Imu, in the body's axes; empty: none.
  bool reliable{
      false};  ///< Ask for repeats of what is lost; a driver that offers none is not heard then.
  /// The senders' clocks are this machine's or follow the same time (PTP, NTP). False, or when
  /// their stamps cannot be right: stamps are placed by the quickest arrivals.
  bool synchronized{true};
  double camera_info_wait_s{
      10};  ///< For the lens of a camera that the configuration does not describe.

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// `/cam0/image_raw` → `/cam0/camera_info`, also of `/cam0/image_raw/compressed`.
[[nodiscard]] std::string camera_info_topic(const std::string& image_topic);
[[nodiscard]] bool is_compressed(const std::string& image_topic);

}  // namespace fiducap::dds
