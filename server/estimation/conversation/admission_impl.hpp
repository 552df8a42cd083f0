#pragma once

// How tags come into a filter's state, and what that makes of the workspace: the other half of
// FilterConversation.
#include <algorithm>

#include "base/assert.hpp"
#include "base/so3.hpp"
#include "estimation/conversation/filter_conversation.hpp"

namespace fiducap {

template <class C>
std::optional<TagVerdict> FilterConversation<C>::judge(const TagObservations& seen,
                                                       const TagToUse& tag,
                                                       const Patience& patience) {
  const double noise_px = coordinates().noise(seen.camera).of(*tag.seen);
  const auto attitude = follower_.camera_attitude(seen.camera, seen.exposed_at);
  return candidates_.judge(seen.camera, seen.exposed_at, *tag.seen, follower_.model_of(seen.camera),
                           noise_px, attitude, patience);
}

template <class C>
void FilterConversation<C>::meet_fresh_tags(const TagObservations& seen, UpdateReport& report) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  if (!follower_.knows_attitude()) return;
  const bool alone = tags_.usable.empty();  // nothing else gives a pose
  Patience patience;
  patience.at_least = alone && !has_imu() && !is_following() ? 1 : kViewsToBelieve;
  patience.forced_after = alone && has_imu() ? kForceWithImu : 0;
  decided_.clear();
  for (const TagToUse& tag : tags_.fresh) {
    if (const auto verdict = judge(seen, tag, patience)) {
      decided_.emplace_back(tag, *verdict);
    } else {
      ++report.tags_pending;
      wait(seen, tag);
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

template <class C>
void FilterConversation<C>::wait(const TagObservations& seen, const TagToUse& tag) {
  if constexpr (C::kRemembersImages) {
    if (!is_following() || !has_imu() || tag.known != nullptr) return;
    const auto attitude = follower_.camera_attitude(seen.camera, seen.exposed_at);
    coordinates().memory().wait(tag.seen->tag_id, attitude->q_WV, state());
  }
}

/// Whether the image in which the tag was first seen, or said to be, shows it where it is now. A
/// misread id is not: it must not say where the tag joins.
template <class C>
bool FilterConversation<C>::is_where_first_seen(const TagObservations& seen, const TagToUse& tag,
                                                const TagVerdict& verdict) {
  if constexpr (C::kRemembersImages) {
    const int tag_id = tag.seen->tag_id;
    auto& memory = coordinates().memory();
    const auto first = memory.first_sight(tag_id);
    if (!first || tag.known != nullptr || !is_following()) return true;
    const TagObservations& then = memory.image(first->number).seen;
    const auto found = std::find_if(then.tags.begin(), then.tags.end(),
                                    [&](const auto& s) { return s.tag_id == tag_id; });
    FIDUCAP_ASSERT(found != then.tags.end());
    const Eigen::Vector3d p_VT = (memory.state_at(first->number)->X_WV(then.camera).inverse() *
                                  (state().X_WV(seen.camera) * verdict.X_VT))
                                     .p;
    // How far the body may be from where it is thought to have been then.
    const double strayed_m =
        coordinates().speed_sigma_m_s() * to_seconds(seen.exposed_at - then.exposed_at);
    return is_seen_at(*found, p_VT, strayed_m, follower_.model_of(then.camera));
  }
  return true;
}

template <class C>
bool FilterConversation<C>::admit_late(const TagToUse& tag, const TagVerdict& verdict,
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
    const auto seen = std::find_if(image.seen.tags.begin(), image.seen.tags.end(),
                                   [&](const auto& s) { return s.tag_id == tag_id; });
    FIDUCAP_ASSERT(seen != image.seen.tags.end());
    // Attitude by all views; place by that image's corners, near the pose of the same branch.
    const CameraModel& model = follower_.model_of(image.seen.camera);
    const Eigen::Quaterniond q_VT = first->q_LV.conjugate() * *verdict.q_WT;
    const auto poses = solve_tag_pose(*seen, model);
    const bool second = angle_between(poses[1].X_VT.q, q_VT) < angle_between(poses[0].X_VT.q, q_VT);
    image.admissions.push_back(
        {tag_id, place_turned_tag(*seen, model, q_VT, poses[second ? 1 : 0].X_VT.p)});
    follow_again(first->number, report);
    memory.stop_waiting(tag_id);
    ++report.tags_added;
    return true;
  }
  return false;
}

/// Through the remembered images once more, with the tags that have joined there since. They were
/// counted and scored when they came.
template <class C>
void FilterConversation<C>::follow_again(long from, UpdateReport& report) {
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
        if (!tags_.usable.empty()) {
          const UpdateReport done = correct(image.seen, 1);
          report.tags_used = done.tags_used;
          report.tags_rejected = done.tags_rejected;
          report.nis = done.nis;
          report.nis_dof = done.nis_dof;
          report.reprojection_px = done.reprojection_px;
        }
        coordinates().correct_by_points(image.seen, number, report);
        memory.renew(number, state());
      }
      for (const auto& admission : image.admissions) {
        const auto tag = std::find_if(image.seen.tags.begin(), image.seen.tags.end(),
                                      [&](const auto& s) { return s.tag_id == admission.tag_id; });
        join(image.seen, *tag, admission.X_VT);
      }
    }
    coordinates().set_learning(true);
  }
}

template <class C>
void FilterConversation<C>::join(const TagObservations& seen, const TagObservation& tag,
                                 const Pose& X_VT) {
  coordinates().augment(seen, tag, X_VT);
  auto& joined = coordinates().state().tags.back();
  joined.first_seen = seen.exposed_at;
  joined.last_seen = seen.exposed_at;
  contradictions_.note_fit(seen.exposed_at);
}

template <class C>
bool FilterConversation<C>::admit(const TagObservations& seen, const TagToUse& tag,
                                  const Pose& X_VT, UpdateReport& report) {
  if (is_in_mode(FilterMode::kAdrift) && !admit_adrift(seen, tag, X_VT)) return false;
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
  // Who may not say where the workspace is waits for a tag of the map, whatever it was told before.
  if (prior != priors_.end() && (anchor_.is_anchored() || map_.may_define_workspace)) {
    const Pose& X_WT = prior->second.X_WT;
    if (!anchor_.is_anchored()) coordinates().forget_past();
    shift_axes(anchor_.by_sighting(coordinates(), seen.camera, X_VT, X_WT), report);
    fuse_prior(coordinates().state(), state().tags.size() - 1, prior->second);
  }
  return true;
}

template <class C>
bool FilterConversation<C>::admit_adrift(const TagObservations& seen, const TagToUse& tag,
                                         const Pose& X_VT) {
  // Nothing links this tag to the old ones but a place in the workspace.
  const auto prior = priors_.find(tag.seen->tag_id);
  if (prior != priors_.end() && anchor_.is_anchored()) {
    const Pose X_BT = state().X_BV[static_cast<std::size_t>(seen.camera)] * X_VT;
    jump(coordinates().X_AB_of(prior->second.X_WT * X_BT.inverse()), seen.exposed_at);
    return true;
  }
  if (tag.known == nullptr && prior == priors_.end()) return false;
  restart();  // the old tags never learned where the workspace is
  return true;
}

template <class C>
void FilterConversation<C>::admit_known(const TagObservations& seen, const TagToUse& tag,
                                        const Pose& X_VT, UpdateReport& report) {
  if (!anchor_.is_anchored()) coordinates().forget_past();  // it does not know where the room is
  shift_axes(anchor_.by_sighting(coordinates(), seen.camera, X_VT, tag.known->X_WT), report);
  coordinates().hold_one(*tag.known, map_.whole, seen.exposed_at);
  tags_.usable.assign(1, tag);
  tags_.usable.front().local = state().find(tag.known->tag_id);
  coordinates().forget_aim();
  correct(seen, filter_rules::kFirstIterations, report);
}

}  // namespace fiducap
