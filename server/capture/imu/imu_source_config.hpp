#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/config_check.hpp"
#include "capture/imu/link_config.hpp"

namespace YAML {
class Node;
}

namespace fiducap {

/// Rotation of an IMU's axes (S) to body axes B: x forward, y left, z up.
///
/// Written as a word, as a list with the reading for each body axis (`[y, -x, z]`: forward is their
/// y, left their −x, up their z), or as the quaternion q_BS, w first. flu: unchanged. frd: forward,
/// right, down, as in autopilots. camera: right, down, forward, as in RealSense and OAK.
struct ImuAxes {
  Eigen::Matrix3d R_BS{Eigen::Matrix3d::Identity()};
  std::string written{"flu"};  ///< As in the configuration.

  [[nodiscard]] bool is_turned() const { return R_BS != Eigen::Matrix3d::Identity(); }
};

/// @return nullopt: neither a word, nor a right-handed choice of axes, nor a unit quaternion
[[nodiscard]] std::optional<ImuAxes> axes_from(std::span<const std::string> words);

/// For the configuration, see base/yaml_values.hpp.
[[nodiscard]] std::optional<std::string> read_value(const YAML::Node& node, ImuAxes& out);
[[nodiscard]] std::string text_of(const ImuAxes& axes);

enum class GyroUnit { kRadians, kDegrees };
enum class AccelUnit { kMetres, kG };

struct ImuUnits {
  GyroUnit gyro{GyroUnit::kRadians};
  AccelUnit accel{AccelUnit::kMetres};

  /// To rad/s and to m/s².
  [[nodiscard]] double gyro_scale() const {
    return gyro == GyroUnit::kDegrees ? 0.017453292519943295 : 1.0;
  }
  [[nodiscard]] double accel_scale() const { return accel == AccelUnit::kG ? 9.80665 : 1.0; }
};

namespace words {
inline constexpr std::array<Word<GyroUnit>, 2> kGyroUnit{
    {{"rad_s", GyroUnit::kRadians}, {"deg_s", GyroUnit::kDegrees}}};
inline constexpr std::array<Word<AccelUnit>, 2> kAccelUnit{
    {{"m_s2", AccelUnit::kMetres}, {"g", AccelUnit::kG}}};
}  // namespace words

template <class V>
void describe(V& v, ImuUnits& c) {
  v.word("gyro", c.gyro, words::kGyroUnit);
  v.word("accel", c.accel, words::kAccelUnit);
}

/// An IMU of Linux's Industrial I/O, through libiio.
struct IioConfig {
  std::string uri{"local:"};  ///< Of libiio: `local:`, or `ip:192.168.1.30` where iiod runs.
  std::string gyro;     ///< Name or id, e.g. `icm42688-gyro`; empty: the first device with one.
  std::string accel;    ///< May be the same device.
  std::string trigger;  ///< Set on both, e.g. `hrtimer0`; empty: not changed.
  double rate_hz{200};  ///< sampling_frequency; 0: not changed.
  int samples{4};       ///< Per read; more cost less, with more latency.

  void check(Checker& checker) const;
};

template <class V>
void describe(V& v, IioConfig& c) {
  v.value("uri", c.uri);
  v.value("gyro", c.gyro);
  v.value("accel", c.accel);
  v.value("trigger", c.trigger);
  v.value("rate_hz", c.rate_hz);
  v.value("samples", c.samples);
}

/// A topic with an IMU: `px4_msgs/SensorCombined` of PX4, or `sensor_msgs/Imu` of ROS 2.
struct ImuTopicConfig {
  std::string topic;  ///< Name of the topic.
  /// Of ROS, where `topic` has the gyroscope only (RealSense): the accelerometer's topic, whose
  /// readings are interpolated to the stamps of the gyroscope. Empty: `topic` has both.
  std::string accel{};
  bool reliable{false};  ///< Reliable QoS; senders without it are not received then.
  /// The sender's clock is synchronised with this machine's; else stamps are placed by arrival.
  bool synchronized{true};

  void check(Checker& checker) const;
};

template <class V>
void describe(V& v, ImuTopicConfig& c) {
  v.value("topic", c.topic);
  v.value("accel", c.accel);
  v.value("reliable", c.reliable);
  v.value("synchronized", c.synchronized);
}

enum class ImuSourceType { kLine, kMavlink, kIio, kPx4, kRos };

/// Source of a body's inertial readings; in the file its keys are beside `type`.
struct ImuSourceConfig {
  ImuSourceType type{ImuSourceType::kLine};
  LinkConfig line;
  MavlinkImuConfig mavlink;
  IioConfig iio;
  ImuTopicConfig px4{"/fmu/out/sensor_combined"};
  ImuTopicConfig ros{"/imu/data"};
  ImuAxes axes;  ///< Of the readings; of MAVLink and PX4: after rotation to flu.
  ImuUnits units;

  /// Its serial line or UDP port; nullptr: none.
  [[nodiscard]] const LinkConfig* link() const {
    if (type == ImuSourceType::kLine) return &line;
    return type == ImuSourceType::kMavlink ? &mavlink.link : nullptr;
  }
  /// @param prefix  e.g. `bodies.0.imu_source.`
  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// Calls `visit` with the configuration of the chosen type.
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

namespace words {
inline constexpr std::array<Word<ImuSourceType>, 5> kImuSourceType{
    {{"line", ImuSourceType::kLine},
     {"mavlink", ImuSourceType::kMavlink},
     {"iio", ImuSourceType::kIio},
     {"px4", ImuSourceType::kPx4},
     {"ros", ImuSourceType::kRos}}};
}  // namespace words

/// Keys of a configuration. `type` is first: it decides which other keys there are.
template <class V>
void describe(V& v, ImuSourceConfig& c) {
  v.word("type", c.type, words::kImuSourceType);
  visit_imu_source(c, [&v](auto& source) { describe(v, source); });
  v.value("axes", c.axes);
  v.section("units", c.units);
}

}  // namespace fiducap
