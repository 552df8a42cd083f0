#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "capture/imu/link_config.hpp"

namespace fiducap {

/// Which of an autopilot's messages are taken. Best: HIGHRES_IMU, else RAW_IMU (of ArduPilot, which
/// scales it), else SCALED_IMU.
enum class MavlinkImuMessage { kBest, kHighres, kRaw, kScaled, kScaled2, kScaled3 };

/// The IMU of an autopilot, PX4 or ArduPilot, over UDP or a serial line.
struct MavlinkImuConfig {
  LinkConfig link;
  int system{0};        ///< The vehicle's system id; 0: the first one that is heard.
  double rate_hz{100};  ///< Asked of the vehicle; 0: nothing is asked.
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

/// Keys of a configuration, see daemon/config/config_schema.hpp.
template <class V>
void describe(V& v, MavlinkImuConfig& c) {
  describe(v, c.link);
  v.value("system", c.system);
  v.value("rate_hz", c.rate_hz);
  v.word("message", c.message, words::kMavlinkImuMessage);
}

}  // namespace fiducap
