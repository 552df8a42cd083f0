#include "estimation/world/camera_moment.hpp"

#include "base/so3.hpp"

namespace fiducap::world {

CameraAt camera_at(const FilterState& state, int camera, double seconds) {
  CameraAt out;
  out.seconds = seconds;
  const Pose X_WB = out.moved() ? state.X_WB_after(seconds) : state.X_WB;
  const Eigen::Vector3d w_B = state.gyro_B - state.bias_w;
  const Eigen::Vector3d w_W = X_WB.q * w_B;
  out.X_WV = X_WB * state.X_BV[static_cast<std::size_t>(camera)];
  out.on_time << state.v_WB + seconds * state.a_WB - w_W.cross(X_WB.p), w_W;
  if (!out.moved()) return out;
  // The part a t²/2 of the path is taken as known: its error is below a micrometre.
  out.on_camera = adjoint(X_WB * state.X_WB.inverse());
  out.on_body = Matrix6d::Identity() - out.on_camera;
  out.on_velocity.topRows<3>() = seconds * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d turn = -seconds * (X_WB.rotation() * right_jacobian_so3(seconds * w_B));
  out.on_gyro_bias << skew(X_WB.p) * turn, turn;
  return out;
}

SharedPose error_of(const CameraAt& at, int camera) {
  SharedPose out;
  Matrix63d on_clock = Matrix63d::Zero();
  on_clock.col(0) = at.on_time;
  out.add(layout::camera(camera), at.on_camera.leftCols<3>());
  out.add(layout::camera(camera) + 3, at.on_camera.rightCols<3>());
  out.add(layout::clock(camera), on_clock);
  if (!at.moved()) return out;
  out.add(layout::kPosition, at.on_body.leftCols<3>());
  out.add(layout::kAttitude, at.on_body.rightCols<3>());
  out.add(layout::kVelocity, at.on_velocity);
  out.add(layout::kBiasW, at.on_gyro_bias);
  return out;
}

}  // namespace fiducap::world
