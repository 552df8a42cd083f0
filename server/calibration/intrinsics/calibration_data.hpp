#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// A flat, rigid thing with points at known places: one tag, a board of tags, a checkerboard.
struct CalibrationTarget {
  std::string name;
  std::vector<Eigen::Vector3d> points;  ///< Metres, target axes, z = 0.
  /// Points come in fours, the corners of tags (bottom-left, bottom-right, top-right, top-left)
  /// where straight lines fitted to the sides meet; a lens bends the sides, so such corners are off
  /// (see side_bend.hpp).
  bool fitted_sides{false};
};

struct SeenPoint {
  int point{};             ///< Index in CalibrationTarget::points.
  Eigen::Vector2d raw_px;  ///< As found; (0, 0) is the centre of the upper-left pixel.
  Eigen::Vector2d
      px;  ///< Raw pixel of the point itself: `raw_px` without the bend of fitted sides.
};

/// One target in one image.
struct TargetSighting {
  int target{};
  std::vector<SeenPoint> points;  ///< Four or more; fours stay together with `fitted_sides`.
  double sharpness{};             ///< 0: not known. See look_at_sides.
};

struct CalibrationView {
  std::string name;  ///< Of the image, for people.
  std::vector<TargetSighting> sightings;
};

/// What a camera saw of targets, nothing known of the camera but its size.
struct CalibrationData {
  int width{};
  int height{};
  std::vector<CalibrationTarget> targets;
  std::vector<CalibrationView> views;
};

[[nodiscard]] std::size_t count_points(const CalibrationData& data);

/// The numbers of a lens in the order of all matrices here: fu fv cu cv, then
/// CameraModel::coefficients.
inline constexpr int kLensNumbers = 9;
using LensVector = Eigen::Matrix<double, kLensNumbers, 1>;

[[nodiscard]] LensVector numbers_of(const CameraModel& camera);
void set_numbers(CameraModel& camera, const LensVector& numbers);

/// A camera and where everything stood. Targets of one group stand still relative to each other.
struct CalibrationState {
  CameraModel camera;
  std::vector<int> group_of;  ///< Per target.
  std::vector<Pose> X_GT;     ///< Per target; the first one of a group defines G and never moves.
  std::vector<std::map<int, Pose>> X_VG;  ///< Per view and group seen in it.

  [[nodiscard]] bool defines_group(std::size_t target) const;
};

}  // namespace fiducap
