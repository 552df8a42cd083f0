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

}  // namespace fiducap::world
