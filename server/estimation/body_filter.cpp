#include "estimation/body_filter.hpp"

#include <algorithm>
#include <cmath>

#include "base/expected.hpp"
#include "estimation/rcars/rcars_filter.hpp"
#include "estimation/update/world_filter.hpp"

namespace fiducap {

Duration shift_to_apply(const ClockEstimate& clock, Duration applied) {
  constexpr double kLeast_s = 1e-3;
  if (std::abs(clock.shift_s) < std::max(kLeast_s, clock.shift_sigma_s)) return Duration{0};
  return std::abs(clock.shift_s - to_seconds(applied)) > kLeast_s ? from_seconds(clock.shift_s)
                                                                  : applied;
}

std::optional<std::string> fault_of_filter(const std::string& name, const BodySensors& sensors) {
  if (name != "robocentric" || sensors.imu) return std::nullopt;
  return "filter robocentric needs an IMU, and this body has none: set filter world";
}

std::unique_ptr<BodyFilter> make_body_filter(const std::string& name, const BodySensors& sensors,
                                             const WorkspaceGauge& gauge,
                                             const EstimatorConfig& config) {
  if (name == "world") return std::make_unique<world::WorldFilter>(sensors, gauge, config);
  FIDUCAP_ASSERT(name == "robocentric");  // the only other value of the configuration
  return std::make_unique<rcars::RcarsFilter>(sensors, gauge, config);
}

}  // namespace fiducap
