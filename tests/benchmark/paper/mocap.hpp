#pragma once

#include <cstdint>
#include <vector>

#include "simulation/estimation_data.hpp"

namespace fiducap::bench {

/// A very good marker system with a hand-sized rigid body in the middle of its volume.
struct MocapNoise {
  double position_m{1e-4};    ///< 1-sigma per axis.
  double rotation_rad{1e-3};  ///< 1-sigma per axis: 0.1 mm over a body of 10 cm.
};

/// Velocity and rate by poses alone: the difference of two neighbouring ones over the time between
/// them, at its middle.
struct PoseDifference {
  double t_s{};  ///< Since the first sample.
  Eigen::Vector3d v_B;
  Eigen::Vector3d w_B;
  Eigen::Vector3d v_B_true;
  Eigen::Vector3d w_B_true;
};

/// Poses at every second IMU instant (100 Hz), so that every difference has the truth of its
/// instant. @pre data has an IMU of even rate
[[nodiscard]] std::vector<PoseDifference> differences_of(const EstimationData& data,
                                                         const MocapNoise& noise,
                                                         std::uint64_t seed);

}  // namespace fiducap::bench
