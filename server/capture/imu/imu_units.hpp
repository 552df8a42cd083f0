#pragma once

#include <array>

#include "base/config_check.hpp"

namespace fiducap {

enum class GyroUnit { kRadians, kDegrees };
enum class AccelUnit { kMetres, kG };

/// The units of the readings, where a device does not keep to SI.
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

/// Keys of a configuration, see daemon/config/config_schema.hpp.
template <class V>
void describe(V& v, ImuUnits& c) {
  v.word("gyro", c.gyro, words::kGyroUnit);
  v.word("accel", c.accel, words::kAccelUnit);
}

}  // namespace fiducap
