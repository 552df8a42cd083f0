#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace fiducap::examples {

using Vector = std::array<double, 3>;

/// Two loops, one inside the other: position error → wanted velocity → velocity error → wanted
/// acceleration.
///
/// The stream has position and velocity, so nothing is differentiated here. An integrator in the
/// inner loop compensates constant disturbances (a slope, wind, a weak battery); it is held while
/// the output is at its limit.
class Cascade {
 public:
  struct Gains {
    double position_1_s{2.0};  ///< Position error → velocity.
    double velocity_1_s{6.0};  ///< Velocity error → acceleration.
    double integral_1_s2{4.0};
    double max_speed_m_s{1.0};
    double max_acceleration_m_s2{4.0};
  };
  explicit Cascade(const Gains& gains) : gains_(gains) {}

  /// Resets the integrator, after an interruption of the poses.
  void reset() { integral_ = {}; }

  /// @param position, velocity  at the instant when the command takes effect (Client::predict_now)
  /// @return the acceleration to command, m/s², W axes
  Vector update(const Vector& target, const Vector& position, const Vector& velocity, double dt_s) {
    Vector wanted = minus(target, position);
    for (double& part : wanted) part *= gains_.position_1_s;
    limit(wanted, gains_.max_speed_m_s);
    const Vector error = minus(wanted, velocity);
    Vector command;
    for (std::size_t i = 0; i < 3; ++i) command[i] = gains_.velocity_1_s * error[i] + integral_[i];
    if (!limit(command, gains_.max_acceleration_m_s2)) {
      for (std::size_t i = 0; i < 3; ++i) integral_[i] += gains_.integral_1_s2 * dt_s * error[i];
    }
    return command;
  }

 private:
  static Vector minus(const Vector& a, const Vector& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  }
  /// @return true when it was clamped
  static bool limit(Vector& v, double most) {
    const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (!(length > most)) return false;
    for (double& part : v) part *= most / length;
    return true;
  }

  Gains gains_;
  Vector integral_{};
};

}  // namespace fiducap::examples
