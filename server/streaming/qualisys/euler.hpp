#pragma once

#include <Eigen/Core>

namespace fiducap::qualisys {

/// QTM's standard angles (roll, pitch, yaw), degrees: R = Rx(a1) · Ry(a2) · Rz(a3), a2 within ±90.
/// At a2 = ±90 only one of a1 ± a3 is defined; a3 is 0 then.
/// @pre R is a rotation
[[nodiscard]] Eigen::Vector3d euler_deg(const Eigen::Matrix3d& R);

}  // namespace fiducap::qualisys
