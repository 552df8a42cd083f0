#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "capture/simulation/simulation.hpp"
#include "estimation/body_filter.hpp"

namespace fiducap {

/// One simulated body followed by one filter, corners only, compared with the truth at every image.
struct FilterRunSetup {
  std::string filter{"robocentric"};
  std::string world{"table"};      ///< Room preset and trajectory kind.
  double seconds{30.0};
  double scored_after_s{5.0};
  std::uint64_t seed{1};
  bool has_imu{true};
  bool true_extrinsics{false};     ///< Given and frozen; else nominal ones, off by a draw of their sigma.
  bool known_map{false};
  simulation::FaultConfig faults{};
  EstimatorConfig estimator{};
};

/// Errors against the truth in the workspace that the filter defines (levelled at the reference tag) or is given.
struct FilterRun {
  struct At {
    double t_s{};
    double position_m{};
    double rotation_rad{};
    double velocity_m_s{};
    double nees{};   ///< 15 degrees of freedom with IMU, 9 (pose, velocity) without.
  };
  std::vector<At> scored;
  int frames{};
  int frames_with_tags{};
  int frames_with_pose{};     ///< … and tags
  double nis{};
  long long nis_dof{};
  int tags_rejected{};
  int tags_used{};
  int tags_dropped{};
  double map_position_m{};    ///< RMSE of the tags in the state, workspace axes.
  int tags_mapped{};

  [[nodiscard]] double position_rmse_m() const;
  [[nodiscard]] double rotation_rmse_rad() const;
  [[nodiscard]] double velocity_rmse_m_s() const;
  [[nodiscard]] double mean_nees() const;
};

[[nodiscard]] FilterRun run_filter(const FilterRunSetup& setup);

}  // namespace fiducap
