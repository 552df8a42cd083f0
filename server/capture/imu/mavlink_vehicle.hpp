#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/time.hpp"
#include "capture/imu/byte_link.hpp"
#include "capture/imu/link_config.hpp"
#include "middleware/mavlink/frame.hpp"

/// An autopilot's vehicle: its choice, its inertial messages (common.xml), requests for them.
namespace fiducap::mavlink {

/// One reading, in the autopilot's axes: x forward, y right, z down.
struct InertialReading {
  std::uint64_t count{};  ///< Of its clock: microseconds, or milliseconds in 32 bits.
  bool counts_ms{false};
  bool is_new{true};  ///< Gyroscope and accelerometer were both read since the last one.
  Eigen::Vector3d w{Eigen::Vector3d::Zero()};  ///< rad/s
  Eigen::Vector3d f{Eigen::Vector3d::Zero()};  ///< m/s²
};

/// HIGHRES_IMU; SCALED_IMU, 2, 3 and ArduPilot's RAW_IMU (0.001 g and 0.001 rad/s). nullopt: none.
[[nodiscard]] std::optional<InertialReading> decode_inertial(const Frame& frame);

/// The chosen message; of `best` HIGHRES_IMU.
[[nodiscard]] MessageId message_of(MavlinkImuMessage choice);

struct Target {
  std::uint8_t system{};
  std::uint8_t component{};
};

/// COMMAND_LONG with MAV_CMD_SET_MESSAGE_INTERVAL.
void encode_message_interval(const Sender& from, const Target& to, MessageId message,
                             double rate_hz, std::vector<std::byte>& out);
/// REQUEST_DATA_STREAM for the raw sensors, for older ArduPilots.
void encode_sensor_stream_request(const Sender& from, const Target& to, double rate_hz,
                                  std::vector<std::byte>& out);

/// Chooses a vehicle on a link: the configured one, else the first, until it has been silent for
/// ten seconds or another one has the better proof. Others are counted and reported once.
class VehicleChoice final {
 public:
  /// @param system  0: the first one
  explicit VehicleChoice(int system) : wanted_(system) {}

  struct Vehicle {
    std::uint8_t system{};
    std::uint8_t component{};
    std::uint8_t autopilot{};  ///< MAV_AUTOPILOT; 0: generic, or no heartbeat yet.
    net::Peer at{};
    Instant received_at{};
  };

  /// @param may_replace  the sender may replace the present vehicle
  /// @return whether the frame is of the chosen vehicle's autopilot
  bool accept(const Frame& frame, const net::Peer& from, Instant now, bool may_replace = false);
  /// Its sender would be chosen if there were no vehicle.
  [[nodiscard]] bool is_candidate(const Frame& frame) const;

  [[nodiscard]] const std::optional<Vehicle>& vehicle() const { return vehicle_; }
  /// Incremented when another vehicle is chosen.
  [[nodiscard]] int changes() const { return changes_; }
  [[nodiscard]] std::uint64_t foreign() const { return foreign_; }  ///< Frames of other vehicles.
  /// Message about another vehicle, once for each.
  [[nodiscard]] std::optional<std::string> take_event() {
    return std::exchange(message_, std::nullopt);
  }
  [[nodiscard]] std::string text_of_vehicle() const;

 private:
  void note_foreign(const Frame& frame, const net::Peer& from);

  int wanted_;
  std::optional<Vehicle> vehicle_;
  int changes_{0};
  std::uint64_t foreign_{0};
  std::bitset<256> named_;
  std::optional<std::string> message_;
};

/// Requests inertial readings until the vehicle sends them at the configured rate: every second,
/// later every ten seconds (reported once). SET_MESSAGE_INTERVAL, then as older ArduPilots do.
class RateRequests final {
 public:
  explicit RateRequests(const MavlinkImuConfig& config)
      : message_(config.message), wanted_hz_(config.rate_hz) {}

  void count(Instant now) {
    measure(now);
    ++in_window_;
  }
  /// Another vehicle was chosen, or it has restarted.
  void restart() {
    window_began_.reset();
    in_window_ = requests_sent_ = 0;
    measured_hz_ = 0;
    next_.reset();
    is_reported_ = false;
  }
  /// @param taken  the message that readings come in now, if any
  void append_due(const Target& vehicle, std::uint8_t autopilot, std::optional<MessageId> taken,
                  Instant now, Sender& from, std::vector<std::byte>& out);

  [[nodiscard]] double measured_hz() const { return measured_hz_; }
  [[nodiscard]] std::optional<std::string> take_event() {
    return std::exchange(report_, std::nullopt);
  }

 private:
  [[nodiscard]] std::vector<MessageId> candidates(std::uint8_t autopilot,
                                                  std::optional<MessageId> taken) const;
  void measure(Instant now);

  MavlinkImuMessage message_;
  double wanted_hz_;
  std::optional<Instant> window_began_;
  int in_window_{0};
  double measured_hz_{0};
  std::optional<Instant> next_;
  int requests_sent_{0};
  bool is_reported_{false};
  std::optional<std::string> report_;
};

}  // namespace fiducap::mavlink
