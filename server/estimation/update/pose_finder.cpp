#include "estimation/update/pose_finder.hpp"

#include <algorithm>

#include "estimation/filter/heading_rule.hpp"

namespace fiducap {

namespace {
// Rotation error of the gyro integrated while the body is lost.
constexpr double kGyroTurn_rad = 0.1;
// The attitude of a tracked body is better known than that from one tag.
constexpr double kKnownTurn_rad = 0.02;
}  // namespace

std::optional<Eigen::Quaterniond> PoseFinder::level_attitude(const world::FilterState& state,
                                                             Instant at) const {
  return has_imu_ ? std::optional(attitude_.q_WB(at, state.bias_w)) : std::nullopt;
}

Pose PoseFinder::turned(const world::FilterState& state, Instant at) const {
  Pose X_WB = state.X_WB;
  if (has_imu_) X_WB.q = X_WB.q * attitude_.q_LB(at, state.bias_w);
  return X_WB;
}

std::optional<CameraAttitude> PoseFinder::camera_attitude(
    const world::FilterState& state, int camera, Instant at,
    std::optional<double> turn_sigma_rad) const {
  const Eigen::Quaterniond& q_BV = state.X_BV[static_cast<std::size_t>(camera)].q;
  if (has_imu_) return CameraAttitude{attitude_.q_LB(at, state.bias_w) * q_BV};
  if (turn_sigma_rad) return CameraAttitude{state.X_WB.q * q_BV, *turn_sigma_rad};
  return std::nullopt;
}

std::optional<PlaceFound> PoseFinder::find(const world::FilterState& state, Instant at,
                                           std::vector<SightedTag> tags, double corner_px) {
  PlaceGuess guess{turned(state, at), kUnknownPosition_m, kUnknownAngle_rad};
  if (has_imu_) {
    if (!is_turn_lost_) guess.rotation_sigma_rad = kGyroTurn_rad;
    return find_place(tags, guess, config_.corner_noise_px);
  }
  if (at != std::exchange(instant_at_, at)) instant_.clear();
  const std::size_t own = tags.size();
  for (const auto& [corners, tag] : instant_) {
    tags.push_back(tag);
    tags.back().seen = &corners;
  }
  auto found = find_place(tags, guess, config_.corner_noise_px);
  for (std::size_t i = 0; i < own; ++i) instant_.emplace_back(*tags[i].seen, tags[i]);
  if (found) found->evidence /= excess(*found, corner_px);
  return found;
}

double PoseFinder::excess(const PlaceFound& found, double corner_px) const {
  const double noise = corner_px / config_.corner_noise_px;
  return std::max({1.0, noise * noise, found.misfit});
}

std::optional<Eigen::Vector3d> PoseFinder::shift_by(const world::FilterState& state,
                                                    const SightedTag& tag) const {
  const PlaceGuess guess{state.X_WB, kUnknownPosition_m, kKnownTurn_rad};
  const auto found = find_place(std::span(&tag, 1), guess, config_.corner_noise_px);
  if (!found) return std::nullopt;
  return found->X_AB.p - guess.X_AB.p;
}

}  // namespace fiducap
