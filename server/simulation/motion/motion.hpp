#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "simulation/simulation.hpp"

/// Curves of body poses, from a plan in the room (motion_plan.cpp) or a file (pose_spline.cpp).
namespace fiducap::simulation {

/// Smooth motion near control poses at equal steps: a uniform quintic B-spline of position and of
/// the quaternion's four numbers, then normalised. Four times continuously differentiable, with
/// exact derivatives. Does not pass through the control poses.
class PoseSpline final {
 public:
  struct Point {
    Pose X;
    Eigen::Vector3d velocity;      ///< ∂p/∂s
    Eigen::Vector3d acceleration;  ///< ∂²p/∂s²
    Eigen::Vector3d rate;          ///< Rotation per s, in the rotating axes.
  };

  static constexpr int kOrder = 6;  ///< Control poses with a weight at one s.
  using Control = Eigen::Matrix<double, 7, Eigen::Dynamic>;  ///< Columns x y z, w x y z.

  /// @param closed  the motion continues from the last control pose to the first
  /// @pre at least kOrder poses, neighbours less than 180° apart, spacing > 0
  PoseSpline(const std::vector<Pose>& control, double spacing, bool closed);
  /// Control columns of an open spline; neighbouring quaternions have a positive product.
  PoseSpline(Control control, double spacing);

  [[nodiscard]] double length() const { return static_cast<double>(pieces_) * spacing_; }
  [[nodiscard]] bool closed() const { return closed_; }
  /// Any s when closed; else clamped into [0, length()].
  [[nodiscard]] Point at(double s) const;
  /// Scales time; the curve stays.
  void set_spacing(double spacing) { spacing_ = spacing; }
  [[nodiscard]] double spacing() const { return spacing_; }

  /// Weights of the kOrder control poses at u in [0, 1] of a piece, or their derivative 1..2 by u.
  [[nodiscard]] static Eigen::Matrix<double, kOrder, 1> weights(double u, int derivative);

 private:
  Control control_;
  double spacing_;
  Eigen::Index pieces_;
  bool closed_;
  /// −1 when one round has an odd number of full turns: q returns as −q.
  double wrap_sign_{1.0};
};

/// A recorded pose; seconds since the first pose of its file.
struct TimedPose {
  double t_s{};
  Pose X_WB;
};

/// Reads EuRoC truth (commas: ns, p, q w first, anything after) or TUM (blanks: s, p, q w last).
/// `#` starts a comment.
/// @return at least kOrder poses with strictly increasing times; else Error with file and line
[[nodiscard]] Expected<std::vector<TimedPose>> read_pose_file(const std::string& path);

/// The smoothest spline near the poses: least squares with a penalty on the fourth difference of
/// its control poses (P. Eilers, B. Marx, "Flexible smoothing with B-splines and penalties", 1996).
/// Bridges gaps smoothly.
[[nodiscard]] PoseSpline fit_spline(const std::vector<TimedPose>& poses);

/// Control poses of the *camera* (X_WV) for a closed motion at equal steps of time.
struct MotionPlan {
  std::vector<Pose> X_WV;
  double spacing_s{};
  /// Limits of the camera: time is scaled so that the first of them is just reached. 0: not scaled.
  double speed_m_s{};
  double rate_rad_s{};
  double acceleration_m_s2{};  ///< Of the body.
};

/// @return nullopt for a kind that is not planned from the room (`file`, unknown).
[[nodiscard]] std::optional<MotionPlan> plan_motion(const TrajectoryConfig& config,
                                                    const RoomConfig& room);

/// Camera axes at p looking at the target, image top towards `up` as far as possible.
[[nodiscard]] Pose look_at(const Eigen::Vector3d& p, const Eigen::Vector3d& target,
                           const Eigen::Vector3d& up);

}  // namespace fiducap::simulation
