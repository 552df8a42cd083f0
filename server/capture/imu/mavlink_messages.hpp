#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "middleware/mavlink/frame.hpp"

/// The messages of common.xml that carry inertial readings, and those that ask for them.
namespace fiducap::mavlink {

/// One reading, in the autopilot's axes: x forward, y right, z down.
struct InertialReading {
  std::uint64_t count{};  ///< Of its clock: microseconds, or milliseconds in 32 bits.
  bool counts_ms{false};
  bool is_new{true};  ///< Gyro and accelerometer were both read since the last one.
  Eigen::Vector3d w{Eigen::Vector3d::Zero()};  ///< rad/s
  Eigen::Vector3d f{Eigen::Vector3d::Zero()};  ///< m/s²
};

/// HIGHRES_IMU; RAW_IMU and SCALED_IMU, 2, 3 in thousandths of g and of rad/s (ArduPilot's RAW_IMU
/// is scaled, too). @return nullopt: none of these
[[nodiscard]] std::optional<InertialReading> decode_inertial(const Frame& frame);

/// Whom a request is for.
struct Target {
  std::uint8_t system{};
  std::uint8_t component{};
};

/// COMMAND_LONG with MAV_CMD_SET_MESSAGE_INTERVAL.
void encode_message_interval(const Sender& from, const Target& to, MessageId message,
                             double rate_hz, std::vector<std::byte>& out);
/// REQUEST_DATA_STREAM for the raw sensors, which older ArduPilots know.
void encode_sensor_stream_request(const Sender& from, const Target& to, double rate_hz,
                                  std::vector<std::byte>& out);

struct CommandAck {
  std::uint16_t command{};
  std::uint8_t result{};
};
[[nodiscard]] CommandAck decode_command_ack(const Frame& frame);

}  // namespace fiducap::mavlink
