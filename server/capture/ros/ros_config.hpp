#pragma once

#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "capture/source_surroundings.hpp"

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

  /// Cameras may have no lens in the configuration: their camera_info tells it.
  static constexpr bool kTellsLenses = true;

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

/// Rules of the source and about the rest of the body.
[[nodiscard]] std::vector<ConfigError> check_source(const RosSourceConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

/// One camera of a body as a topic of ROS 2.
struct RosCameraConfig {
  std::string image;  ///< As RosSourceConfig::images.
  bool reliable{false};
  bool synchronized{true};
  double camera_info_wait_s{10};

  static constexpr bool kTellsLenses = true;

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

}  // namespace fiducap::dds
