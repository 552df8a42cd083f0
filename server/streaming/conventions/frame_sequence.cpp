#include "streaming/conventions/frame_sequence.hpp"

#include "base/pose.hpp"

namespace fiducap {

namespace {

// Below, a client's Kalman filter treats it as noise; above, it needs seconds to converge.
constexpr double kSmallestJump_m = 0.10;
constexpr double kSmallestJump_rad = 0.10;
constexpr double kSigmas = 6.0;
constexpr double kHardBraking_m_s2 = 50.0;  // deviation from constant velocity
constexpr double kHardTurning_rad_s2 = 500.0;

}  // namespace

void PoseJumps::observe(const SceneFrame& frame) {
  if (bodies_.size() != frame.bodies.size()) bodies_.resize(frame.bodies.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const BodyPose& body = frame.bodies[i];
    Seen& seen = bodies_[i];
    if (seen.body_id != body.body_id) seen = Seen{.body_id = body.body_id};
    if (body.valid) {
      if (seen.ever && (!seen.valid || seen.axes != frame.axes || is_jump(seen, body, frame.at)))
        ++seen.count;
      seen.axes = frame.axes;
      seen.ever = true;
      seen.at = frame.at;
      seen.X_WP = body.X_WP;
    }
    seen.valid = body.valid;
  }
}

bool PoseJumps::is_jump(const Seen& before, const BodyPose& now, Instant at) {
  const double dt = to_seconds(at - before.at);
  const Eigen::Vector3d moved = now.X_WP.p - before.X_WP.p - now.v_WP * dt;
  const Eigen::Quaterniond expected = before.X_WP.q * exp_so3(now.w_WP_P * dt);
  const double turned = log_so3(expected.conjugate() * now.X_WP.q).norm();
  return moved.norm() >
             kSmallestJump_m + kSigmas * now.position_sigma_m() + kHardBraking_m_s2 * dt * dt ||
         turned >
             kSmallestJump_rad + kSigmas * now.rotation_sigma_rad() + kHardTurning_rad_s2 * dt * dt;
}

}  // namespace fiducap
