#pragma once

#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap::dds {

/// Sensors of a body as topics of ROS 2, from any driver of a camera or an IMU.
struct RosSourceConfig {
  /// One topic per camera: sensor_msgs/Image; CompressedImage if it ends in `/compressed`.
  std::vector<std::string> images;
  std::string imu;  ///< sensor_msgs/Imu, in the body's axes; empty: none.
  /// Where `imu` has the gyroscope only (RealSense): the accelerometer's topic, sensor_msgs/Imu.
  /// Its readings are interpolated to the stamps of the gyroscope.
  std::string accel;
  /// Reliable QoS; drivers without it are not received then.
  bool reliable{false};
  /// The senders' clocks are synchronised with this machine's (PTP, NTP). Else: placed by arrival.
  bool synchronized{true};
  /// For the lens of a camera that the configuration does not describe.
  double camera_info_wait_s{10};

  /// Cameras may have no lens in the configuration: it comes from their camera_info.
  static constexpr bool kProvidesLenses = true;

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

template <class V>
void describe(V& v, RosSourceConfig& c) {
  v.value("images", c.images);
  v.value("imu", c.imu);
  v.value("accel", c.accel);
  v.value("reliable", c.reliable);
  v.value("synchronized", c.synchronized);
  v.value("camera_info_wait_s", c.camera_info_wait_s);
}

[[nodiscard]] std::vector<ConfigError> check_source(const RosSourceConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

/// One camera of a body as a topic of ROS 2.
struct RosCameraConfig {
  RosSourceConfig source{.images = {""}, .imu = ""};  ///< Of one topic, without an IMU.

  static constexpr bool kProvidesLenses = true;
  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

template <class V>
void describe(V& v, RosCameraConfig& c) {
  v.value("image", c.source.images.front());
  v.value("reliable", c.source.reliable);
  v.value("synchronized", c.source.synchronized);
  v.value("camera_info_wait_s", c.source.camera_info_wait_s);
}

/// `/imu/data`
[[nodiscard]] bool is_topic_name(const std::string& name);

}  // namespace fiducap::dds
