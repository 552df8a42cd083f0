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

/// The camera against Vicon: its pose on the rig and its clock, by least squares over all centres.
struct CameraClock {
  Pose X_RV;
  double offset_s{};  ///< t_vicon = t_camera + offset, in the middle of the run.
  double offset_sigma_s{};
  double window_scatter_s{};  ///< Standard deviation of the offset over windows of 10 s, without
                              ///< drift.
  double drift{};             ///< Seconds per second.
  double drift_sigma{};
  double reprojection_median_px{};
  double period_median_s{};  ///< Of images with tags.
  double longest_gap_s{};    ///< Without any tag.
  std::size_t images{};

  [[nodiscard]] double to_vicon(double t_s, double middle_s) const {
    return t_s + offset_s + drift * (t_s - middle_s);
  }
};

/// The IMU against Vicon, by its rates.
struct ImuClock {
  Eigen::Quaterniond q_RI{Eigen::Quaterniond::Identity()};
  double offset_s{};          ///< t_vicon = t_imu + offset
  double window_scatter_s{};  ///< Standard deviation of the offset over windows of 10 s.
  double drift{};             ///< Of the line through the windows.
  double rate_rms_rad_s{};    ///< Residual.
  double period_median_s{};
  double lost_share{};  ///< Steps longer than 1.5 medians.
  double longest_gap_s{};
};

[[nodiscard]] CameraClock measure_camera_clock(const StarlocRun& run);
/// @pre !run.imu.empty()
[[nodiscard]] ImuClock measure_imu_clock(const StarlocRun& run);

/// The middle of the run on the camera's clock.
[[nodiscard]] double middle_of(const StarlocRun& run);

/// A filter over a run, against Vicon.
struct StarlocTracking {
  int images{};  ///< With centres and truth at that time, after the first two seconds of help.
  int with_pose{};
  double median_m{};
  double rmse_m{};
  double p95_m{};
  double worst_m{};
  double worst_at_s{};  ///< Since the first image.
  double rmse_rad{};
  double covered{};  ///< Share of images whose true position is in the reported 95 % ellipsoid.
  int starts{};      ///< Squares placed: at the beginning, and whenever the filter had no pose.
  int helped{};      ///< Images with a square.
  int rejected{};
  int used{};
  double pnp_median_m{};  ///< Least squares over the centres of one image, four tags or more.
  int pnp_images{};
};

struct StarlocChoice {
  std::string filter{"world"};
  bool corrected_clocks{true};  ///< False: stamps as recorded.
  bool use_imu{true};
  double centre_sigma_px{6};  ///< Of a centre against the map, all causes.
};

/// A centre is a tag of 1 mm: four corners on one point, its place known to 3 cm, its attitude
/// unknown. Four corners of twice the sigma make one point of the sigma. No filter starts from
/// points, so during the first two seconds, and while the filter has no pose, an image of four tags
/// or more also has a square of 1 m, three metres ahead, by the image's own least squares pose.
[[nodiscard]] StarlocTracking track(const StarlocRun& run, const CameraClock& camera,
                                    const ImuClock* imu, const StarlocChoice& choice);

}  // namespace fiducap::bench
