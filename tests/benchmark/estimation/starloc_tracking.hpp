#pragma once

#include <string>

#include "estimation/starloc_clocks.hpp"

namespace fiducap::bench {

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
  bool mended_clocks{true};  ///< False: stamps as recorded.
  bool use_imu{true};
  double centre_sigma_px{6};  ///< Of a centre against the map, all causes.
};

/// A centre enters as a tag of 1 mm: four corners on one point, its place known to 3 cm, its
/// attitude to nothing. Four corners of twice the sigma make one point of the sigma. No filter can
/// start from points, so during the first two seconds, and where the filter has no pose, an image
/// of four tags or more also has a square of 1 m, three metres ahead, put there by the image's own
/// least squares pose.
[[nodiscard]] StarlocTracking track(const StarlocRun& run, const CameraClock& camera,
                                    const ImuClock* imu, const StarlocChoice& choice);

}  // namespace fiducap::bench
