#pragma once

#include <optional>

namespace fiducap::simulation {

/// How far along its path a body is: at rest first, then gently up to full speed, four times
/// continuously differentiable. On a path with an end it slows down, comes back, and so on for
/// ever.
class TimeWarp final {
 public:
  struct Point {
    double s;       ///< Path parameter, seconds at full speed.
    double first;   ///< ds/dt
    double second;  ///< d²s/dt²
  };

  /// @param length  of the path; nullopt when it is closed.  @pre length > 0
  explicit TimeWarp(std::optional<double> length);
  /// @param t  seconds since the start; before 0 it is at rest.
  [[nodiscard]] Point at(double t) const;

  static constexpr double kRest_s = 1.0;
  static constexpr double kRamp_s = 2.0;

 private:
  [[nodiscard]] Point leg(double t) const;

  std::optional<double> length_;
  double ramp_;
};

}  // namespace fiducap::simulation
