#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/update/body_follower.hpp"

namespace fiducap {

template <class C>
bool BodyFollower<C>::add(const ImuSample& imu) {
  const std::optional<ImuSample> before = imu_.newest();
  if (!imu_.push(imu)) return true;
  const auto& state = coordinates_.state();
  if (before) attitude_.add(*before, state.bias_w, state.bias_f);
  const bool is_blind = mode_ == FilterMode::kLost && imu_.is_gyro_blind();
  if (is_blind) {
    is_turn_lost_ = true;
    attitude_.restart();
  }
  if (mode_ != FilterMode::kRunning) {
    imu_.keep_newest_pair();
  } else if (imu_.is_full()) {
    // No image for long: propagates without one and drops the remembered images. The newest sample
    // may still end the interval of an image.
    coordinates_.forget_past();
    integrate_to(imu_.before_newest().sampled_at);
    coordinates_.finish_motion();
  }
  return !is_blind;
}

template <class C>
std::optional<PlaceFound> BodyFollower<C>::find_place(const TagObservations& seen,
                                                      std::span<const TagToUse> usable) {
  PlaceGuess guess{turned(seen.exposed_at), kUnknownPosition_m, kUnknownAngle_rad};
  std::vector<SightedTag> tags = coordinates_.sighted(seen.camera, usable);
  if (has_imu()) {
    if (!is_turn_lost_) guess.rotation_sigma_rad = filter_rules::kGyroTurn_rad;
    return fiducap::find_place(tags, guess, config_.corner_noise_px);
  }
  if (seen.exposed_at != std::exchange(instant_at_, seen.exposed_at)) instant_.clear();
  const std::size_t own = tags.size();
  for (const auto& [corners, tag] : instant_) {
    tags.push_back(tag);
    tags.back().seen = &corners;
  }
  auto found = fiducap::find_place(tags, guess, config_.corner_noise_px);
  for (std::size_t i = 0; i < own; ++i) instant_.emplace_back(*tags[i].seen, tags[i]);
  if (found) found->evidence /= excess(*found, seen.camera);
  return found;
}

template <class C>
std::optional<Eigen::Vector3d> BodyFollower<C>::shift_by(const TagObservations& seen,
                                                         const TagToUse& tag) const {
  // The attitude of a tracked body is better known than that from one tag.
  constexpr double kKnownTurn_rad = 0.02;
  const PlaceGuess guess{coordinates_.X_AB(), kUnknownPosition_m, kKnownTurn_rad};
  const auto found = fiducap::find_place(coordinates_.sighted(seen.camera, std::span(&tag, 1)),
                                         guess, config_.corner_noise_px);
  if (!found) return std::nullopt;
  const Eigen::Quaterniond q_WA = coordinates_.X_WB().q * guess.X_AB.q.conjugate();
  return q_WA * (found->X_AB.p - guess.X_AB.p);
}

template <class C>
std::optional<CameraAttitude> BodyFollower<C>::camera_attitude(int camera, Instant at) const {
  const auto& state = coordinates_.state();
  const Eigen::Quaterniond& q_BV = state.X_BV[static_cast<std::size_t>(camera)].q;
  if (has_imu()) return CameraAttitude{attitude_.q_LB(at, state.bias_w) * q_BV};
  if (is_running())
    return CameraAttitude{coordinates_.X_WB().q * q_BV, coordinates_.turn_sigma_rad()};
  return std::nullopt;
}

template <class C>
BodyEstimate BodyFollower<C>::estimate() const {
  const auto& state = coordinates_.state();
  BodyEstimate out = coordinates_.body();
  out.w_WB_B = -state.bias_w;
  if (has_imu() && imu_.newest()) {
    const InertialInput input = imu_.input_between(state.time, state.time);
    out.w_WB_B = input.w_B - state.bias_w;
    out.a_WB = coordinates_.acceleration_W(input.f_B - state.bias_f) +
               Eigen::Vector3d(0, 0, -(sensors_.gravity_m_s2 + out.gravity_offset_m_s2));
  }
  return out;
}

template <class C>
void BodyFollower<C>::integrate_to(Instant to) {
  const auto& state = coordinates_.state();
  if (!has_imu()) return step_to(to, motion_without_imu(config_), filter_rules::kStepWithoutImu_s);
  while (state.time < to) {
    const Instant end = imu_.end_of_interval(state.time, to);
    step_to(end, imu_.input_between(state.time, end), filter_rules::kStepWithImu_s);
  }
  imu_.forget_before(coordinates_.needed_since().value_or(to));
}

template <class C>
void BodyFollower<C>::step_to(Instant to, const InertialInput& input, double longest_s) {
  auto& state = coordinates_.state();
  while (state.time < to) {
    const Instant end = std::min(to, state.time + from_seconds(longest_s));
    coordinates_.step(input, to_seconds(end - state.time));
    state.time = end;
    if (has_imu()) jump_search_.note_motion(end, coordinates_.X_WB());
  }
}

template <class C>
bool BodyFollower<C>::move_by_corners(const TagObservations& seen,
                                      std::span<const TagToUse> usable) {
  const auto& state = coordinates_.state();
  const double dt = to_seconds(seen.exposed_at - state.time);
  const double wander =
      config_.motion_accel_m_s2_rtHz * dt * std::sqrt(dt) + kStartVelocity_m_s * 0.1 * dt + 0.01;
  const double turning = config_.motion_angular_rad_s2_rtHz * dt * std::sqrt(dt) + 0.1 * dt + 0.01;
  const Pose expected =
      coordinates_.X_AB() * Pose{exp_so3(-state.bias_w * dt), coordinates_.v_B() * dt};
  const auto found =
      fiducap::find_place(coordinates_.sighted(seen.camera, usable), {expected, wander, turning},
                          config_.corner_noise_px, filter_rules::kOtherBranch_rad);
  if (!found || found->evidence < filter_rules::kEvidenceToFollow * excess(*found, seen.camera))
    return false;
  if (usable.size() == 1 && found->surprise > filter_rules::kMostSurprise) return false;
  coordinates_.aim(coordinates_.X_AB().inverse() * found->X_AB, dt);
  integrate_to(seen.exposed_at);
  coordinates_.finish_aimed_motion();
  return true;
}

}  // namespace fiducap
