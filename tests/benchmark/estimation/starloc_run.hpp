#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap::bench {

/// A run of the STAR-loc recordings (utiasASRL/starloc, arXiv 2309.05518) in their own CSV form: a
/// stereo rig R carried through a Vicon hall W with surveyed tags, of which only the centres were
/// published.
struct StarlocRun {
  struct Centre {
    double t_s{};  ///< Camera's clock.
    int tag_id{};
    Eigen::Vector2d left_px;
    Eigen::Vector2d right_px;
  };
  struct Inertial {
    double t_s{};  ///< IMU's clock.
    Eigen::Vector3d w_I;
    Eigen::Vector3d f_I;
  };
  struct Place {
    double t_s{};  ///< Vicon's clock.
    Pose X_WR;
  };

  std::string name;
  CameraModel camera;  ///< Rectified: both cameras, no lens.
  double baseline_m{};
  Pose X_RV;  ///< Left camera, as published; 10° off in setups s1 and s2.
  std::vector<Centre> centres;
  std::vector<Inertial> imu;  ///< Empty in two of the four runs.
  std::vector<Place> truth;   ///< Without the rows that are marked as glitches.
  std::map<int, Eigen::Vector3d> tags;

  /// Interpolated; nullopt outside and in holes longer than `hole_s`.
  [[nodiscard]] std::optional<Pose> rig_at(double t_s, double hole_s = 1.5) const;
};

/// @param folder  of the run
[[nodiscard]] Expected<StarlocRun> read_starloc(const std::string& folder);

}  // namespace fiducap::bench
