// How the world filter loses the body, and finds it again among tags that it knows.
#include <algorithm>

#include "estimation/filter/filter_rules.hpp"
#include "estimation/world/workspace_axes.hpp"
#include "estimation/world/world_filter.hpp"

namespace fiducap::world {

using namespace layout;        // NOLINT: the block names are the subject of this file
using namespace filter_rules;  // NOLINT: short names for what both filters go by

namespace {
// A gyro that was blind for so long that the attitude may be off by this, 1-sigma, leaves nothing
// to linearise at.
constexpr double kBlindTurn_rad = 0.4;
// So many others, seen so often, say that the filter is right and a lone tag wrong, if it is not
// young.
constexpr int kVouchers = 2;
constexpr int kSightingsToVouch = 20;
}  // namespace

/// Images contradict, but all by the same tag.
bool WorldFilter::is_one_tag_against_all() const {
  const auto vouches = [&](const WorldTag& tag) {
    return !scores_.is_suspect(tag.tag_id) && (tag.held || tag.sightings >= kSightingsToVouch);
  };
  const auto is_local = [](const TagToUse& tag) { return tag.local >= 0; };
  return has_imu() && !start_log_.is_open() && !reliving_ &&
         std::all_of(usable_.begin(), usable_.end(), is_local) && scores_.suspects() == 1 &&
         std::count_if(state_.tags.begin(), state_.tags.end(), vouches) >= kVouchers;
}

void WorldFilter::lose_motion() {
  if (mode_ != Mode::kRunning) return;
  if (!running()) return restart();
  mode_ = Mode::kAdrift;
  motion_.restart();
  attitude_.restart();
  candidates_.forget_all();
  memory_.forget_all();
  state_.forget_clones();
  return_attempts_ = 0;
}

bool WorldFilter::has_turned_blindly() const {
  return has_imu() &&
         state_.P().diagonal().segment<3>(kAttitude).maxCoeff() > kBlindTurn_rad * kBlindTurn_rad;
}

bool WorldFilter::come_back(const TagObservations& seen) {
  PlaceGuess guess{state_.X_WB, kUnknownPosition_m, kUnknownAngle_rad};
  if (has_imu()) {
    if (!attitude_.ready()) return false;
    guess.X_AB.q = state_.X_WB.q * attitude_.q_LB(seen.exposed_at, state_.bias_w);
    if (!is_attitude_lost_) guess.rotation_sigma_rad = kGyroTurn_rad;
  }
  const auto found = find_place(sighted(seen.camera), guess, config_.corner_noise_px);
  ++return_attempts_;
  const bool forced = return_attempts_ >= (has_imu() ? kForceWithImu : kForceWithoutImu);
  if (found && (found->evidence >= config_.branch_evidence || forced)) {
    jump(found->X_AB, seen.exposed_at);
    return true;
  }
  return has_imu() && come_back_by_views(seen);
}

bool WorldFilter::come_back_by_views(const TagObservations& seen) {
  const CornerNoise& noise = corner_noise_[static_cast<std::size_t>(seen.camera)];
  for (const TagToUse& tag : usable_) {
    const auto attitude = camera_attitude(seen.camera, seen.exposed_at);
    const auto verdict =
        candidates_.judge(seen.camera, seen.exposed_at, *tag.seen, model_of(seen.camera),
                          noise.of(*tag.seen), attitude, Patience{});
    if (!verdict) continue;
    const Pose X_BT = state_.X_BV[static_cast<std::size_t>(seen.camera)] * verdict->X_VT;
    jump(place_of(state_, tag) * X_BT.inverse(), seen.exposed_at);
    return true;
  }
  return false;
}

void WorldFilter::jump(const Pose& X_WB, Instant at) {
  forget_motion(state_, X_WB, has_imu());
  motion_.restart();
  state_.time = at;
  mode_ = Mode::kRunning;
  is_attitude_lost_ = false;
  candidates_.forget_all();
  scores_.clear();
  barren_updates_ = 0;
  strained_updates_ = 0;
}

}  // namespace fiducap::world
