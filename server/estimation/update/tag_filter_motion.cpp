// TagFilter: the motion of the body between images.
#include <algorithm>
#include <cmath>

#include "estimation/filter/filter_rules.hpp"
#include "estimation/update/tag_filter.hpp"
#include "estimation/world/workspace_axes.hpp"

namespace fiducap {

using namespace world;         // NOLINT: the state and its operations
using namespace filter_rules;  // NOLINT: short names

namespace {
// Largest chi-square of the motion implied by a single tag: beyond, the tag was moved.
constexpr double kMostSurprise = 100.0;
}  // namespace

/// @return false when the gyroscope is saturated: views compared by it are invalid
bool TagFilter::add_reading(const ImuSample& imu) {
  ImuBuffer& buffer = propagator_.imu();
  const std::optional<ImuSample> before = buffer.newest();
  if (!buffer.push(imu)) return true;
  if (before) pose_finder_.add(*before, state_);
  const bool is_blind = mode_ == FilterMode::kLost && buffer.is_gyro_blind();
  if (is_blind) pose_finder_.restart(true);
  if (mode_ != FilterMode::kRunning) {
    buffer.keep_newest_pair();
  } else if (buffer.is_full()) {
    // No image for long: propagates without one and drops the remembered images. The newest sample
    // may still end the interval of an image.
    memory_.forget_all();
    integrate_to(buffer.before_newest().sampled_at);
    finish_motion();
  }
  return !is_blind;
}

void TagFilter::start_motion(Instant at) {
  start(state_, at, pose_finder_.level_attitude(state_, at));
  propagator_.restart();
  mode_ = FilterMode::kRunning;
  contradictions_.note_fit(at);
}

void TagFilter::lose_motion(bool is_turn_lost) {
  if (!is_following()) return;
  if (!running()) return restart();
  mode_ = FilterMode::kLost;
  place_doubt_.close();
  propagator_.restart();
  image_update_.lose_motion();
  memory_.forget_all();
  state_.forget_clones();
  pose_finder_.restart(is_turn_lost);
  candidates_.forget_all();
  relocalisation_attempts_ = 0;
}

/// Sets the body to X_WB, motion unknown.
void TagFilter::jump(const Pose& X_WB, Instant at) {
  jump_search_.forget_all();
  forget_motion(state_, X_WB, has_imu());
  image_update_.lose_motion();
  propagator_.restart();
  state_.time = at;
  mode_ = FilterMode::kRunning;
  pose_finder_.note_found();
  candidates_.forget_all();
  contradictions_.reset();
}

/// Propagates the state to the image.
/// @return false: not possible without IMU and usable tags
bool TagFilter::propagate_to(const TagObservations& seen) {
  if (seen.exposed_at == state_.time) return true;  // another camera, same instant
  if (!has_imu()) return !tags_.usable.empty() && move_by_corners(seen);
  integrate_to(seen.exposed_at);
  finish_motion();
  return true;
}

void TagFilter::integrate_to(Instant to) {
  propagator_.integrate(state_, to, image_update_.imu_variance(), jump_search_);
  if (has_imu()) propagator_.imu().forget_before(memory_.needed_since().value_or(to));
}

void TagFilter::finish_motion() {
  image_update_.follow(propagator_.motion());
  propagator_.finish(state_);
}

bool TagFilter::move_by_corners(const TagObservations& seen) {
  const double dt = to_seconds(seen.exposed_at - state_.time);
  const double wander =
      config_.motion_accel_m_s2_rtHz * dt * std::sqrt(dt) + kStartVelocity_m_s * 0.1 * dt + 0.01;
  const double turning = config_.motion_angular_rad_s2_rtHz * dt * std::sqrt(dt) + 0.1 * dt + 0.01;
  const Eigen::Vector3d v_B = state_.X_WB.q.conjugate() * state_.v_WB;
  const Pose expected = state_.X_WB * Pose{exp_so3(-state_.bias_w * dt), v_B * dt};
  const auto found =
      find_place(image_update_.sighted(state_, seen.camera, tags_.usable),
                 {expected, wander, turning}, config_.corner_noise_px, kOtherBranch_rad);
  const double corner_px = image_update_.noise(seen.camera).unexplained_px();
  if (!found || found->evidence < kEvidenceToFollow * pose_finder_.excess(*found, corner_px))
    return false;
  if (tags_.usable.size() == 1 && found->surprise > kMostSurprise) return false;
  propagator_.aim(state_, state_.X_WB.inverse() * found->X_AB, dt);
  integrate_to(seen.exposed_at);
  propagator_.finish_aimed(state_);
  return true;
}

std::optional<CameraAttitude> TagFilter::camera_attitude(int camera, Instant at) const {
  const auto turn_sigma = is_following() ? std::optional(turn_sigma_rad()) : std::nullopt;
  return pose_finder_.camera_attitude(state_, camera, at, turn_sigma);
}

/// Smallest attitude error relative to the workspace or a tag of this image; 1-sigma per axis.
double TagFilter::turn_sigma_rad() const {
  using layout::kAttitude;
  const auto trace = [P = state_.P()](int a, int b) { return P.block<3, 3>(a, b).trace(); };
  const double body = trace(kAttitude, kAttitude);
  double least = body;
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    if (state_.tags[i].last_seen != state_.time) continue;
    const int at = state_.tag_at(i) + 3;
    least = std::min(least, body + trace(at, at) - 2 * trace(kAttitude, at));
  }
  return std::sqrt(std::max(0.0, least) / 3);
}

/// Position of the body by a single tag, relative to the estimate, W axes.
std::optional<Eigen::Vector3d> TagFilter::shift_by(const TagObservations& seen,
                                                   const TagToUse& tag) const {
  const auto sighted = image_update_.sighted(state_, seen.camera, std::span(&tag, 1));
  return pose_finder_.shift_by(state_, sighted.front());
}

}  // namespace fiducap
