#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "capture/imu/iio_config.hpp"
#include "capture/imu/imu_axes.hpp"
#include "capture/imu/imu_units.hpp"
#include "capture/imu/link_config.hpp"
#include "capture/imu/mavlink_config.hpp"

namespace fiducap {

enum class ImuSourceType { kLine, kMavlink, kIio, kPx4, kRos };

/// A topic with an IMU. PX4: `px4_msgs/SensorCombined` over its uXRCE-DDS bridge; ROS 2:
/// `sensor_msgs/Imu`.
struct ImuTopicConfig {
  std::string topic;
  bool reliable{
      false};  ///< Ask for repeats of what is lost; a sender that offers none is not heard.
  /// The sender's clock is this machine's or follows the same time; else, or when that cannot be:
  /// placed by the quickest arrivals.
  bool synchronized{true};
};

template <class V>
void describe(V& v, ImuTopicConfig& c) {
  v.value("topic", c.topic);
  v.value("reliable", c.reliable);
  v.value("synchronized", c.synchronized);
}

/// Where a body's inertial readings come from. `type` decides which of the others is read; in the
/// file their keys stand directly beside it.
struct ImuSourceConfig {
  ImuSourceType type{ImuSourceType::kLine};
  LinkConfig line;
  MavlinkImuConfig mavlink;
  IioConfig iio;
  ImuTopicConfig px4{"/fmu/out/sensor_combined"};
  ImuTopicConfig ros{"/imu/data"};
  ImuAxes axes;  ///< Of the readings; of MAVLink and PX4: after they were turned to flu.
  ImuUnits units;

  /// The serial line or UDP port that it comes by; nullptr: another way.
  [[nodiscard]] const LinkConfig* link() const {
    if (type == ImuSourceType::kLine) return &line;
    return type == ImuSourceType::kMavlink ? &mavlink.link : nullptr;
  }
  /// @param prefix  e.g. `bodies.0.imu_source.`
  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

namespace words {
inline constexpr std::array<Word<ImuSourceType>, 5> kImuSourceType{
    {{"line", ImuSourceType::kLine},
     {"mavlink", ImuSourceType::kMavlink},
     {"iio", ImuSourceType::kIio},
     {"px4", ImuSourceType::kPx4},
     {"ros", ImuSourceType::kRos}}};
}  // namespace words

/// Calls `visit` with the configuration of the type that was chosen.
template <class Config, class Visit>
decltype(auto) visit_imu_source(Config& source, Visit&& visit) {
  switch (source.type) {
    case ImuSourceType::kMavlink:
      return visit(source.mavlink);
    case ImuSourceType::kIio:
      return visit(source.iio);
    case ImuSourceType::kPx4:
      return visit(source.px4);
    case ImuSourceType::kRos:
      return visit(source.ros);
    case ImuSourceType::kLine:
      break;
  }
  return visit(source.line);
}

/// `type` comes first: it decides which other keys there are.
template <class V>
void describe(V& v, ImuSourceConfig& c) {
  v.word("type", c.type, words::kImuSourceType);
  visit_imu_source(c, [&v](auto& source) { describe(v, source); });
  v.value("axes", c.axes);
  v.section("units", c.units);
}

}  // namespace fiducap
