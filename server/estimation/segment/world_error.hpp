#pragma once

#include <Eigen/Core>

#include "estimation/segment/motion_segment.hpp"

namespace fiducap {

using Vector15d = Eigen::Matrix<double, 15, 1>;

/// Errors on the world's side, in the order of world::layout: X = Exp(ξ) X̂, v = exp(φ) v̂ + J_l(φ)
/// ν, biases as they are. A common turn and shift of the room is the same ξ for everything in it.
[[nodiscard]] BodyMoment moved(const BodyMoment& body, const Vector15d& error);
/// The error that leads from one to the other.
[[nodiscard]] Vector15d error_between(const BodyMoment& from, const BodyMoment& to);
/// The room is moved: X ← G X.
[[nodiscard]] BodyMoment in_other_axes(const Pose& G, const BodyMoment& body);
/// J_l(ξ)⁻¹ of the group of poses: ξ changes by this times a further, small error on the world's
/// side. Barfoot, State Estimation for Robotics, 7.83.
[[nodiscard]] Matrix6d inverse_left_jacobian(const Vector6d& error);

}  // namespace fiducap
