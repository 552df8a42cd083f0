#pragma once

// Part of TagFilter: how tags join the state and anchor the workspace.
#include <algorithm>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "estimation/update/tag_filter.hpp"

namespace fiducap {

using namespace filter_rules;  // NOLINT: included by sources alone

/// Whether a sighting may show a tag at this position in camera axes, known to `sigma_m`: two tags
/// never overlap.
[[nodiscard]] inline bool is_seen_at(const TagObservation& seen, const Eigen::Vector3d& p_VT,
                                     double sigma_m, const CameraModel& camera) {
  constexpr double kLeast_px = 10.0;
  constexpr double kSigmas = 3.0;
  if (!(p_VT.z() > 0)) return false;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double side_px = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    centre += 0.25 * seen.corners_px[i];
    side_px = std::max(side_px, (seen.corners_px[i] - seen.corners_px[(i + 1) % 4]).norm());
  }
  return (centre - camera.pinhole(p_VT)).norm() <
         std::max(kLeast_px, 0.8 * side_px) + kSigmas * sigma_m * camera.fu / p_VT.z();
}

template <class C>
std::optional<TagVerdict> TagFilter<C>::judge(const TagObservations& seen, const TagToUse& tag,
                                              const ViewLimits& limits) {
  const double noise_px = coordinates().noise(seen.camera).of(*tag.seen);
  const auto attitude = follower_.camera_attitude(seen.camera, seen.exposed_at);
  return candidates_.judge(seen.camera, seen.exposed_at, *tag.seen, follower_.model_of(seen.camera),
                           noise_px, attitude, limits);
}

template <class C>
void TagFilter<C>::initialise_new_tags(const TagObservations& seen, UpdateReport& report) {
  if (!follower_.knows_attitude()) return;
  const bool alone = tags_.usable.empty();  // no other pose
  ViewLimits limits;
  limits.at_least = alone && !has_imu() && !is_following() ? 1 : kViewsToBelieve;
  limits.forced_after = alone && has_imu() ? kForceWithImu : 0;
  decided_.clear();
  for (const TagToUse& tag : tags_.fresh) {
    if (const auto verdict = judge(seen, tag, limits)) {
      decided_.emplace_back(tag, *verdict);
      continue;
    }
    ++report.tags_pending;
    if constexpr (C::kRemembersImages) {
      if (!is_following() || !has_imu() || tag.known != nullptr) continue;
      const auto attitude = follower_.camera_attitude(seen.camera, seen.exposed_at);
      coordinates().memory().wait(tag.seen->tag_id, attitude->q_WV, state());
    }
  }
  for (const auto& [tag, verdict] : decided_) {
    if (!is_where_first_seen(seen, tag, verdict)) {
      coordinates().forget_first_sight(tag.seen->tag_id);
      ++report.tags_pending;
      continue;
    }
    if (!admit_late(tag, verdict, report) && !admit(seen, tag, verdict.X_VT, report))
      ++report.tags_pending;
  }
}

/// Whether the first image of the tag shows it at its present position. False for a misread id,
/// which must not define where the tag joins.
template <class C>
bool TagFilter<C>::is_where_first_seen(const TagObservations& seen, const TagToUse& tag,
                                       const TagVerdict& verdict) {
  if constexpr (C::kRemembersImages) {
    const int tag_id = tag.seen->tag_id;
    auto& memory = coordinates().memory();
    const auto first = memory.first_sight(tag_id);
    if (!first || tag.known != nullptr || !is_following()) return true;
    const TagObservations& then = memory.image(first->number).seen;
    const auto found = std::ranges::find(then.tags, tag_id, &TagObservation::tag_id);
    FIDUCAP_ASSERT(found != then.tags.end());
    const Eigen::Vector3d p_VT = (memory.state_at(first->number)->X_WV(then.camera).inverse() *
                                  (state().X_WV(seen.camera) * verdict.X_VT))
                                     .p;
    const double sigma_m =  // of the body's motion since then
        coordinates().speed_sigma_m_s() * to_seconds(seen.exposed_at - then.exposed_at);
    return is_seen_at(*found, p_VT, sigma_m, follower_.model_of(then.camera));
  }
  return true;
}

template <class C>
bool TagFilter<C>::admit_late(const TagToUse& tag, const TagVerdict& verdict,
                              UpdateReport& report) {
  if constexpr (C::kRemembersImages) {
    const int tag_id = tag.seen->tag_id;
    auto& memory = coordinates().memory();
    const auto first = memory.first_sight(tag_id);
    if (!first || !verdict.q_WT || tag.known != nullptr ||
        static_cast<int>(state().tags.size()) >= follower_.config().max_local_tags) {
      return false;
    }
    auto& image = memory.image(first->number);
    const auto seen = std::ranges::find(image.seen.tags, tag_id, &TagObservation::tag_id);
    FIDUCAP_ASSERT(seen != image.seen.tags.end());
    // Attitude by all views; position by that image's corners, near the pose of the same branch.
    const CameraModel& model = follower_.model_of(image.seen.camera);
    const Eigen::Quaterniond q_VT = first->q_LV.conjugate() * *verdict.q_WT;
    const auto poses = solve_tag_pose(*seen, model);
    const bool second = angle_between(poses[1].X_VT.q, q_VT) < angle_between(poses[0].X_VT.q, q_VT);
    image.admissions.push_back(
        {tag_id, solve_tag_position(*seen, model, q_VT, poses[second ? 1 : 0].X_VT.p)});
    follow_again(first->number, report);
    memory.stop_waiting(tag_id);
    ++report.tags_added;
    return true;
  }
  return false;
}

/// Processes the remembered images again, with the tags that have joined since. Counts and scores
/// are not changed.
template <class C>
void TagFilter<C>::follow_again(long from, UpdateReport& report) {
  if constexpr (C::kRemembersImages) {
    auto& memory = coordinates().memory();
    coordinates().set_learning(false);
    coordinates().state() = *memory.state_at(from);
    for (long number = from; number <= memory.newest(); ++number) {
      auto& image = memory.image(number);
      if (number > from) {
        coordinates().look_at(image.seen);
        sort(image.seen, image.known);
        follower_.move_to(image.seen, tags_.usable);
        if (!tags_.usable.empty()) report.take_correction(correct(image.seen, 1));
        coordinates().correct_by_points(image.seen, number, report);
        memory.renew(number, state());
      }
      for (const auto& admission : image.admissions) {
        const auto tag =
            std::ranges::find(image.seen.tags, admission.tag_id, &TagObservation::tag_id);
        join(image.seen, *tag, admission.X_VT);
      }
    }
    coordinates().set_learning(true);
  }
}

template <class C>
void TagFilter<C>::join(const TagObservations& seen, const TagObservation& tag, const Pose& X_VT) {
  coordinates().augment(seen, tag, X_VT);
  auto& joined = coordinates().state().tags.back();
  joined.first_seen = seen.exposed_at;
  joined.last_seen = seen.exposed_at;
  contradictions_.note_fit(seen.exposed_at);
}

template <class C>
bool TagFilter<C>::admit(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                         UpdateReport& report) {
  if (is_in_mode(FilterMode::kLost) && !admit_while_lost(seen, tag, X_VT)) return false;
  if (is_in_mode(FilterMode::kStarting)) {
    follower_.start(seen.exposed_at);
    contradictions_.note_fit(seen.exposed_at);
  }
  if (tag.known != nullptr) {
    admit_known(seen, tag, X_VT, report);
    return true;
  }
  if (static_cast<int>(state().tags.size()) >= follower_.config().max_local_tags) return false;
  if constexpr (C::kRemembersImages) {
    auto& memory = coordinates().memory();
    if (memory.newest() >= 0)
      memory.image(memory.newest()).admissions.push_back({tag.seen->tag_id, X_VT});
  }
  join(seen, *tag.seen, X_VT);
  ++report.tags_added;
  const auto prior = priors_.find(tag.seen->tag_id);
  // A body that may not define the workspace waits for a tag of the map.
  if (prior != priors_.end() && (anchor_.is_anchored() || map_.may_define_workspace)) {
    const Pose& X_WT = prior->second.X_WT;
    if (!anchor_.is_anchored()) coordinates().forget_past();
    shift_axes(anchor_.by_sighting(coordinates(), seen.camera, X_VT, X_WT), report);
    fuse_prior(coordinates().state(), state().tags.size() - 1, prior->second);
  }
  return true;
}

template <class C>
bool TagFilter<C>::admit_while_lost(const TagObservations& seen, const TagToUse& tag,
                                    const Pose& X_VT) {
  // Only its pose in the workspace links this tag to the earlier ones.
  const auto prior = priors_.find(tag.seen->tag_id);
  if (prior != priors_.end() && anchor_.is_anchored()) {
    const Pose X_BT = state().X_BV[static_cast<std::size_t>(seen.camera)] * X_VT;
    jump(coordinates().X_AB_of(prior->second.X_WT * X_BT.inverse()), seen.exposed_at);
    return true;
  }
  if (tag.known == nullptr && prior == priors_.end()) return false;
  restart();  // the earlier tags are not anchored
  return true;
}

template <class C>
void TagFilter<C>::admit_known(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                               UpdateReport& report) {
  if (!anchor_.is_anchored()) coordinates().forget_past();
  shift_axes(anchor_.by_sighting(coordinates(), seen.camera, X_VT, tag.known->X_WT), report);
  coordinates().hold_one(*tag.known, map_.whole, seen.exposed_at);
  tags_.usable.assign(1, tag);
  tags_.usable.front().local = state().find(tag.known->tag_id);
  coordinates().forget_aim();
  correct(seen, kFirstIterations, report);
}

}  // namespace fiducap
