#pragma once

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// Targets and groups have signed ids, -1: none.
[[nodiscard]] constexpr std::size_t to_index(int id) { return static_cast<std::size_t>(id); }

/// A flat, rigid object with known points: one tag, a board of tags, a checkerboard.
struct CalibrationTarget {
  std::string name;
  std::vector<Eigen::Vector3d> points;  ///< Metres, target axes, z = 0.
  /// Points are groups of four, the corners of tags (bottom-left, bottom-right, top-right,
  /// top-left), as intersections of lines fitted to the sides. The lens bends the sides, which
  /// biases such corners (unbend_corners).
  bool fitted_sides{false};
};

struct SeenPoint {
  int point{};             ///< Index in CalibrationTarget::points.
  Eigen::Vector2d raw_px;  ///< As detected; (0, 0) is the centre of the upper-left pixel.
  Eigen::Vector2d px;      ///< `raw_px` without the bias of fitted sides.
};

/// One target in one image.
struct TargetSighting {
  int target{};
  std::vector<SeenPoint> points;  ///< Four or more; complete groups with `fitted_sides`.
  double sharpness{};             ///< 0: unknown. See measure_sides.
};

struct CalibrationView {
  std::string name;  ///< Of the image, for messages.
  std::vector<TargetSighting> sightings;
};

/// Images of targets by a camera of known image size.
struct CalibrationData {
  int width{};
  int height{};
  std::vector<CalibrationTarget> targets;
  std::vector<CalibrationView> views;

  [[nodiscard]] const CalibrationTarget& target_of(const TargetSighting& s) const {
    return targets[to_index(s.target)];
  }
};

[[nodiscard]] inline std::size_t count_points(const CalibrationData& data) {
  std::size_t count = 0;
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& sighting : view.sightings) count += sighting.points.size();
  return count;
}

/// Sightings per target.
[[nodiscard]] inline std::vector<int> count_sightings(const CalibrationData& data) {
  std::vector<int> counts(data.targets.size(), 0);
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& s : view.sightings) ++counts[to_index(s.target)];
  return counts;
}

/// A camera with the poses of all targets. Targets of one group do not move relative to each other.
struct CalibrationState {
  CameraModel camera;
  /// 1-sigma of a prior that each coefficient of a rational lens is 0; 0: no prior.
  double coefficient_sigma{0};
  std::vector<int> group_of;              ///< Per target.
  std::vector<Pose> X_GT;                 ///< Per target; the first one of a group defines G.
  std::vector<std::map<int, Pose>> X_VG;  ///< Per view and group seen in it.

  [[nodiscard]] int group(const TargetSighting& s) const { return group_of[to_index(s.target)]; }
  /// @pre its group has a pose in view v
  [[nodiscard]] Pose X_VT(std::size_t v, const TargetSighting& s) const {
    return X_VG[v].at(group(s)) * X_GT[to_index(s.target)];
  }
  [[nodiscard]] bool defines_group(std::size_t target) const {
    return std::find(group_of.begin(), group_of.end(), group_of[target]) - group_of.begin() ==
           static_cast<std::ptrdiff_t>(target);
  }
};

}  // namespace fiducap
