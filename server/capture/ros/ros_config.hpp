#pragma once

#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap::dds {

/// Sensors of a body as topics of ROS 2, from any driver of a camera or an IMU.
struct RosSourceConfig {
  /// Per camera of the body, in their order. sensor_msgs/Image; CompressedImage when the name ends
  /// in `/compressed`.
  std::vector<std::string> images;
  std::string imu;  ///< sensor_msgs/Imu, in the body's axes; empty: none.
  /// Reliable QoS; drivers without it are not received then.
  bool reliable{false};
  /// The senders' clocks are this machine's or synchronised with it (PTP, NTP). If false, or when
  /// their stamps are impossible, stamps are placed by arrival.
  bool synchronized{true};
  /// For the lens of a camera that the configuration does not describe.
  double camera_info_wait_s{10};

  /// Cameras may have no lens in the configuration: it comes from their camera_info.
  static constexpr bool kProvidesLenses = true;

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// Keys of a configuration, see daemon/config/config_schema.hpp.
template <class V>
void describe(V& v, RosSourceConfig& c) {
  v.value("images", c.images);
  v.value("imu", c.imu);
  v.value("reliable", c.reliable);
  v.value("synchronized", c.synchronized);
  v.value("camera_info_wait_s", c.camera_info_wait_s);
}

/// @return broken rules of the source and of the body around it
[[nodiscard]] std::vector<ConfigError> check_source(const RosSourceConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

/// One camera of a body as a topic of ROS 2.
struct RosCameraConfig {
  std::string image;  ///< As RosSourceConfig::images.
  bool reliable{false};
  bool synchronized{true};
  double camera_info_wait_s{10};

  static constexpr bool kProvidesLenses = true;

  /// The same as a source without an IMU.
  [[nodiscard]] RosSourceConfig as_source() const;
  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

template <class V>
void describe(V& v, RosCameraConfig& c) {
  v.value("image", c.image);
  v.value("reliable", c.reliable);
  v.value("synchronized", c.synchronized);
  v.value("camera_info_wait_s", c.camera_info_wait_s);
}

/// `/imu/data`
[[nodiscard]] bool is_topic_name(const std::string& name);

}  // namespace fiducap::dds
