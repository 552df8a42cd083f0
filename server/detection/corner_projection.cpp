#include "detection/corner_projection.hpp"

#include <Eigen/LU>

#include "base/so3.hpp"

namespace fiducap {

namespace {
// Closer than this the pinhole model blows up; no real camera focuses there.
constexpr double kMinDepth_m = 1e-3;
}  // namespace

Eigen::Vector3d tag_corner(int i, double edge_m) {
  const double h = 0.5 * edge_m;
  return {(i == 1 || i == 2) ? h : -h, i >= 2 ? h : -h, 0.0};
}

CornerResidual corner_residual(const TagObservation& seen, const Pose& X_VT,
                               const CameraModel& camera, double size) {
  CornerResidual out;
  const Eigen::Matrix3d R_VT = X_VT.rotation();
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d arm = R_VT * tag_corner(i, size * seen.edge_m);
    const Eigen::Vector3d p = X_VT.p + arm;
    if (p.z() < kMinDepth_m) {
      out.in_front = false;
      return out;
    }
    const double iz = 1.0 / p.z();
    Eigen::Matrix<double, 2, 3> d_pixel_d_point;
    d_pixel_d_point << camera.fu * iz, 0, -camera.fu * p.x() * iz * iz,  //
        0, camera.fv * iz, -camera.fv * p.y() * iz * iz;
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Matrix2d raw_from_ideal = seen.ideal_from_raw[k].inverse();
    out.y.segment<2>(2 * i) = raw_from_ideal * (seen.corners_px[k] - camera.pinhole(p));
    const Eigen::Matrix<double, 2, 3> J = raw_from_ideal * d_pixel_d_point;
    out.H.block<2, 3>(2 * i, 0) = J;
    out.H.block<2, 3>(2 * i, 3) = -J * skew(arm);
    out.H_size.segment<2>(2 * i) = J * arm / size;
  }
  return out;
}

}  // namespace fiducap
