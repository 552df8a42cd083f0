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

/// The vehicle of an autopilot: its choice, its inertial messages (common.xml), and requests for
/// them.
namespace fiducap::mavlink {

/// One reading, in the autopilot's axes: x forward, y right, z down.
struct InertialReading {
  std::uint64_t count{};  ///< Of its clock: microseconds, or milliseconds in 32 bits.
  bool counts_ms{false};
  bool is_new{true};  ///< Gyroscope and accelerometer were both read since the last one.
  Eigen::Vector3d w{Eigen::Vector3d::Zero()};  ///< rad/s
  Eigen::Vector3d f{Eigen::Vector3d::Zero()};  ///< m/s²
};

/// HIGHRES_IMU; RAW_IMU and SCALED_IMU, 2, 3 in thousandths of g and of rad/s (ArduPilot's RAW_IMU
/// is scaled, too). @return nullopt: none of these
[[nodiscard]] std::optional<InertialReading> decode_inertial(const Frame& frame);

/// Receiver of a request.
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

/// Chooses one of the vehicles on a link: the configured one, else the first one, until it has been
/// silent for ten seconds or another one has the better proof. Others are counted and reported
/// once.
class VehicleChoice final {
 public:
  /// @param system  0: the first one
  explicit VehicleChoice(int system) : wanted_(system) {}

  struct Vehicle {
    std::uint8_t system{};
    std::uint8_t component{};
    std::uint8_t autopilot{};  ///< MAV_AUTOPILOT; 0: generic, or no heartbeat yet.
    LinkPeer at{};
    Instant received_at{};
  };

  /// @param may_replace  the sender may replace the present vehicle
  /// @return whether the frame is of the chosen vehicle's autopilot
  bool accept(const Frame& frame, const LinkPeer& from, Instant now, bool may_replace = false);
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
  void note_foreign(const Frame& frame, const LinkPeer& from);

  int wanted_;
  std::optional<Vehicle> vehicle_;
  int changes_{0};
  std::uint64_t foreign_{0};
  std::bitset<256> named_;
  std::optional<std::string> message_;
};

/// Requests inertial readings at the configured rate until the vehicle sends them: by
/// SET_MESSAGE_INTERVAL, then in the way of older ArduPilots. Once a second at first, then every
/// ten seconds, which is reported once.
class RateRequests final {
 public:
  explicit RateRequests(const MavlinkImuConfig& config)
      : message_(config.message), wanted_hz_(config.rate_hz) {}

  /// A reading came.
  void count(Instant now);
  /// Another vehicle was chosen, or it has restarted.
  void restart();
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
