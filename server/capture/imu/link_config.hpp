#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "base/config_check.hpp"

namespace fiducap {

/// A serial line, or a UDP port.
struct LinkConfig {
  std::string device;              ///< e.g. `/dev/ttyACM0`; empty: UDP.
  int baud{115200};                ///< Any rate of the line; 8N1. USB devices ignore it.
  std::string address{"0.0.0.0"};  ///< UDP, ours.
  std::uint16_t port{0};  ///< UDP, ours; 0: any free one, for a peer that we contact first.
  /// UDP: the only accepted sender, `192.168.1.20` or with a port; empty: any.
  std::string peer;

  /// UDP from any machine: the first sender is accepted.
  [[nodiscard]] bool takes_the_first_sender() const {
    return device.empty() && peer.empty() && !address.starts_with("127.");
  }
  void check(Checker& checker) const;
};

template <class V>
void describe(V& v, LinkConfig& c) {
  v.value("device", c.device);
  v.value("baud", c.baud);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("peer", c.peer);
}

/// Messages of an autopilot. Best: HIGHRES_IMU, else RAW_IMU (of ArduPilot), else SCALED_IMU.
enum class MavlinkImuMessage { kBest, kHighres, kRaw, kScaled, kScaled2, kScaled3 };

/// The IMU of an autopilot, PX4 or ArduPilot, over UDP or a serial line.
struct MavlinkImuConfig {
  LinkConfig link;
  int system{0};        ///< The vehicle's system id; 0: the first one received.
  double rate_hz{100};  ///< Requested of the vehicle; 0: no request.
  MavlinkImuMessage message{MavlinkImuMessage::kBest};

  void check(Checker& checker) const;
};

namespace words {
inline constexpr std::array<Word<MavlinkImuMessage>, 6> kMavlinkImuMessage{
    {{"best", MavlinkImuMessage::kBest},
     {"highres_imu", MavlinkImuMessage::kHighres},
     {"raw_imu", MavlinkImuMessage::kRaw},
     {"scaled_imu", MavlinkImuMessage::kScaled},
     {"scaled_imu2", MavlinkImuMessage::kScaled2},
     {"scaled_imu3", MavlinkImuMessage::kScaled3}}};
}  // namespace words

template <class V>
void describe(V& v, MavlinkImuConfig& c) {
  describe(v, c.link);
  v.value("system", c.system);
  v.value("rate_hz", c.rate_hz);
  v.word("message", c.message, words::kMavlinkImuMessage);
}

}  // namespace fiducap
