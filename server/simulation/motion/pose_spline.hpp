#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"

namespace fiducap::simulation {

/// A smooth motion given by control poses at equal steps: uniform quintic B-spline, four times
/// continuously differentiable, in position and in the quaternion's four numbers, which are then
/// normalised.
///
/// The curve stays near its control poses, it does not pass through them. Derivatives are exact.
class PoseSpline final {
 public:
  struct Point {
    Pose X;
    Eigen::Vector3d velocity;      ///< ∂p/∂s
    Eigen::Vector3d acceleration;  ///< ∂²p/∂s²
    Eigen::Vector3d rate;          ///< Rotation per s, in the turning axes.
  };

  static constexpr int kOrder = 6;                           ///< Control poses that act at one s.
  using Control = Eigen::Matrix<double, 7, Eigen::Dynamic>;  ///< Columns x y z, w x y z.

  /// @param closed  the motion goes on from the last control pose to the first; else it starts and
  /// ends inside.
  /// @pre at least kOrder poses, neighbours less than 180° apart, spacing > 0
  PoseSpline(const std::vector<Pose>& control, double spacing, bool closed);
  /// Raw control columns of an open spline, quaternions already on one side.
  PoseSpline(Control control, double spacing);

  [[nodiscard]] double length() const { return static_cast<double>(pieces_) * spacing_; }
  [[nodiscard]] bool closed() const { return closed_; }
  /// Any s when closed; else clamped into [0, length()].
  [[nodiscard]] Point at(double s) const;
  /// The same curve run through in another time.
  void set_spacing(double spacing) { spacing_ = spacing; }
  [[nodiscard]] double spacing() const { return spacing_; }

  /// Weights of the kOrder control poses at u in [0, 1] of a piece; `derivative` 0..2, by u.
  [[nodiscard]] static Eigen::Matrix<double, kOrder, 1> weights(double u, int derivative);

 private:
  Control control_;
  double spacing_;
  Eigen::Index pieces_;
  bool closed_;
  double wrap_sign_{1.0};  ///< −1 when one round turns the body by an odd number of full turns: q
                           ///< comes back as −q.
};

}  // namespace fiducap::simulation
