#pragma once

#include <optional>

#include "estimation/body_filter.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// The configured cameras and clocks, no motion, no tags.
/// @param clones  number of camera poses for tracked points
void reset(FilterState& state, const BodySensors& sensors, const EstimatorConfig& config,
           const ClockHypothesis& clocks, std::size_t clones);

/// Begins the motion at the origin. @param q_WB  nullopt: without IMU
void start(FilterState& state, Instant at, const std::optional<Eigen::Quaterniond>& q_WB);

/// Makes the time shift of a camera uncertain. No effect when clocks are not estimated.
void open_clock(FilterState& state, const BodySensors& sensors, const EstimatorConfig& config,
                int camera, double sigma_s);

[[nodiscard]] ClockEstimate clock_of(const FilterState& state, int camera);

}  // namespace fiducap::world
