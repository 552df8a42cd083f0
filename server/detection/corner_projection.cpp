#include "detection/corner_projection.hpp"

#include <Eigen/LU>

#include "base/so3.hpp"
#include "capture/lens/lens.hpp"

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
                               const CameraModel& camera, double size, double k1) {
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
    Eigen::Matrix<double, 2, 3> J = raw_from_ideal * d_pixel_d_point;
    const FirstBend bend(camera.distortion, p.head<2>() * iz);
    const Eigen::Vector2d focal(camera.fu, camera.fv);
    out.H_k1.segment<2>(2 * i) = focal.cwiseProduct(bend.point());
    if (k1 != 0) {
      out.y.segment<2>(2 * i) -= k1 * out.H_k1.segment<2>(2 * i);
      J += k1 * (focal.asDiagonal() * bend.raw_from_ideal() * focal.cwiseInverse().asDiagonal()) *
           d_pixel_d_point;
    }
    out.H.block<2, 3>(2 * i, 0) = J;
    out.H.block<2, 3>(2 * i, 3) = -J * skew(arm);
    out.H_size.segment<2>(2 * i) = J * arm / size;
  }
  return out;
}

}  // namespace fiducap
