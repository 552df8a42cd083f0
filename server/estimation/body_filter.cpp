#include "estimation/body_filter.hpp"

#include "base/assert.hpp"
#include "estimation/robocentric/robocentric_filter.hpp"
#include "estimation/world/world_filter.hpp"

namespace fiducap {

std::unique_ptr<BodyFilter> make_body_filter(const std::string& name, const BodySensors& sensors,
                                             const WorkspaceGauge& gauge, const EstimatorConfig& config) {
  if (name == "world") return std::make_unique<world::WorldFilter>(sensors, gauge, config);
  FIDUCAP_ASSERT(name == "robocentric");  // the configuration admits no other
  return std::make_unique<robocentric::RobocentricFilter>(sensors, gauge, config);
}

}  // namespace fiducap
