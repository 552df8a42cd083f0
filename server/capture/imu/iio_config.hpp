#pragma once

#include <string>

#include "base/config_check.hpp"

namespace fiducap {

/// An IMU of Linux's Industrial I/O, through libiio.
struct IioConfig {
  std::string uri{"local:"};  ///< Of libiio: `local:`, or `ip:192.168.1.30` where iiod runs.
  std::string gyro;  ///< Name or id of the device, e.g. `icm42688-gyro`; empty: the first with one.
  std::string accel;    ///< May be the same device.
  std::string trigger;  ///< Set on both, e.g. `hrtimer0`; empty: left as it is.
  double rate_hz{200};  ///< sampling_frequency; 0: left as it is.
  int samples{4};       ///< Per read: more cost less, and come later.

  void check(Checker& checker) const;
};

/// Keys of a configuration, see daemon/config/config_schema.hpp.
template <class V>
void describe(V& v, IioConfig& c) {
  v.value("uri", c.uri);
  v.value("gyro", c.gyro);
  v.value("accel", c.accel);
  v.value("trigger", c.trigger);
  v.value("rate_hz", c.rate_hz);
  v.value("samples", c.samples);
}

}  // namespace fiducap
