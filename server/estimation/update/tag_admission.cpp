// TagFilter: how tags join the state and anchor the workspace.
#include <algorithm>
#include <cmath>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/update/tag_filter.hpp"

namespace fiducap {

using namespace world;         // NOLINT: the state and its operations
using namespace filter_rules;  // NOLINT: short names

namespace {
// Sightings before a tag is accepted.
constexpr int kViewsToBelieve = 3;

/// Whether a sighting may show a tag at this position in camera axes, known to `sigma_m`: two tags
/// never overlap.
bool is_seen_at(const TagObservation& seen, const Eigen::Vector3d& p_VT, double sigma_m,
                const CameraModel& camera) {
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
}  // namespace

std::optional<TagVerdict> TagFilter::judge(const TagObservations& seen, const TagToUse& tag,
                                           const ViewLimits& limits) {
  const double noise_px = image_update_.noise(seen.camera).of(*tag.seen);
  const auto verdict =
      candidates_.judge(seen.camera, seen.exposed_at, *tag.seen, model_of(seen.camera), noise_px,
                        camera_attitude(seen.camera, seen.exposed_at), limits);
  if (verdict)
    image_update_.noise(seen.camera).learn_from_views(*tag.seen, verdict->cost, verdict->numbers);
  return verdict;
}

void TagFilter::initialise_new_tags(const TagObservations& seen, UpdateReport& report) {
  if (!pose_finder_.knows_attitude()) return;
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
    if (!is_following() || !has_imu() || tag.known != nullptr) continue;
    const auto attitude = camera_attitude(seen.camera, seen.exposed_at);
    memory_.wait(tag.seen->tag_id, attitude->q_WV, state_);
  }
  for (const auto& [tag, verdict] : decided_) {
    if (!is_where_first_seen(seen, tag, verdict)) {
      memory_.stop_waiting(tag.seen->tag_id);
      ++report.tags_pending;
      continue;
    }
    if (!admit_late(tag, verdict, report) && !admit(seen, tag, verdict.X_VT, report))
      ++report.tags_pending;
  }
}

/// Whether the first image of the tag shows it at its present position. False for a misread id,
/// which must not define where the tag joins.
bool TagFilter::is_where_first_seen(const TagObservations& seen, const TagToUse& tag,
                                    const TagVerdict& verdict) {
  const int tag_id = tag.seen->tag_id;
  const auto first = memory_.first_sight(tag_id);
  if (!first || tag.known != nullptr || !is_following()) return true;
  const TagObservations& then = memory_.image(first->number).seen;
  const auto found = std::ranges::find(then.tags, tag_id, &TagObservation::tag_id);
  FIDUCAP_ASSERT(found != then.tags.end());
  const Eigen::Vector3d p_VT = (memory_.state_at(first->number)->X_WV(then.camera).inverse() *
                                (state_.X_WV(seen.camera) * verdict.X_VT))
                                   .p;
  const double sigma_m =  // of the body's motion since then
      std::sqrt(state_.P().diagonal().segment<3>(layout::kVelocity).sum()) *
      to_seconds(seen.exposed_at - then.exposed_at);
  return is_seen_at(*found, p_VT, sigma_m, model_of(then.camera));
}

bool TagFilter::admit_late(const TagToUse& tag, const TagVerdict& verdict, UpdateReport& report) {
  const int tag_id = tag.seen->tag_id;
  const auto first = memory_.first_sight(tag_id);
  if (!first || !verdict.q_WT || tag.known != nullptr ||
      static_cast<int>(state_.tags.size()) >= config_.max_local_tags) {
    return false;
  }
  auto& image = memory_.image(first->number);
  const auto seen = std::ranges::find(image.seen.tags, tag_id, &TagObservation::tag_id);
  FIDUCAP_ASSERT(seen != image.seen.tags.end());
  // Attitude by all views; position by that image's corners, near the pose of the same branch.
  const CameraModel& model = model_of(image.seen.camera);
  const Eigen::Quaterniond q_VT = first->q_LV.conjugate() * *verdict.q_WT;
  const auto poses = solve_tag_pose(*seen, model);
  const bool second = angle_between(poses[1].X_VT.q, q_VT) < angle_between(poses[0].X_VT.q, q_VT);
  image.admissions.push_back(
      {tag_id, solve_tag_position(*seen, model, q_VT, poses[second ? 1 : 0].X_VT.p)});
  follow_again(first->number, report);
  memory_.stop_waiting(tag_id);
  ++report.tags_added;
  return true;
}

/// Processes the remembered images again, with the tags that have joined since. Counts and scores
/// are not changed.
void TagFilter::follow_again(long from, UpdateReport& report) {
  image_update_.set_learning(false);
  state_ = *memory_.state_at(from);
  for (long number = from; number <= memory_.newest(); ++number) {
    auto& image = memory_.image(number);
    if (number > from) {
      image_update_.look_at(state_, image.seen);
      sort(image.seen, image.known);
      (void)propagate_to(image.seen);
      if (!tags_.usable.empty()) report.take_correction(correct(image.seen, 1));
      correct_by_points(image.seen, number, report);
      memory_.renew(number, state_);
    }
    for (const auto& admission : image.admissions) {
      const auto tag =
          std::ranges::find(image.seen.tags, admission.tag_id, &TagObservation::tag_id);
      join(image.seen, *tag, admission.X_VT);
    }
  }
  image_update_.set_learning(true);
}

void TagFilter::join(const TagObservations& seen, const TagObservation& tag, const Pose& X_VT) {
  // A tag that was removed has another size, if it was not moved.
  image_update_.calibration().watch_print(
      state_, tag.tag_id, contradictions_.tags().was_removed(tag.tag_id, Instant::min()));
  augment(state_, seen.camera, model_of(seen.camera), tag, X_VT, image_update_.noise(seen.camera));
  WorldTag& joined = state_.tags.back();
  joined.first_seen = seen.exposed_at;
  joined.last_seen = seen.exposed_at;
  contradictions_.note_fit(seen.exposed_at);
}

bool TagFilter::admit(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                      UpdateReport& report) {
  if (mode_ == FilterMode::kLost && !admit_while_lost(seen, tag, X_VT)) return false;
  if (mode_ == FilterMode::kStarting) start_motion(seen.exposed_at);
  if (tag.known != nullptr) {
    admit_known(seen, tag, X_VT, report);
    return true;
  }
  if (static_cast<int>(state_.tags.size()) >= config_.max_local_tags) return false;
  if (memory_.newest() >= 0)
    memory_.image(memory_.newest()).admissions.push_back({tag.seen->tag_id, X_VT});
  join(seen, *tag.seen, X_VT);
  ++report.tags_added;
  const auto prior = priors_.find(tag.seen->tag_id);
  // A body that may not define the workspace waits for a tag of the map.
  if (prior != priors_.end() && (anchor_.is_anchored() || map_.may_define_workspace)) {
    const Pose& X_WT = prior->second.X_WT;
    if (!anchor_.is_anchored()) memory_.forget_all();
    shift_axes(anchor_.by_sighting(state_, seen.camera, X_VT, X_WT), report);
    fuse_prior(state_, state_.tags.size() - 1, prior->second);
  }
  return true;
}

bool TagFilter::admit_while_lost(const TagObservations& seen, const TagToUse& tag,
                                 const Pose& X_VT) {
  // Only its pose in the workspace links this tag to the earlier ones.
  const auto prior = priors_.find(tag.seen->tag_id);
  if (prior != priors_.end() && anchor_.is_anchored()) {
    const Pose X_BT = state_.X_BV[static_cast<std::size_t>(seen.camera)] * X_VT;
    jump(prior->second.X_WT * X_BT.inverse(), seen.exposed_at);
    return true;
  }
  if (tag.known == nullptr && prior == priors_.end()) return false;
  restart();  // the earlier tags are not anchored
  return true;
}

void TagFilter::admit_known(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                            UpdateReport& report) {
  if (!anchor_.is_anchored()) memory_.forget_all();
  shift_axes(anchor_.by_sighting(state_, seen.camera, X_VT, tag.known->X_WT), report);
  hold_one(state_, *tag.known, map_.whole, seen.exposed_at);
  tags_.usable.assign(1, tag);
  tags_.usable.front().local = state_.find(tag.known->tag_id);
  propagator_.forget_aim();
  correct(seen, kFirstIterations, report);
}

}  // namespace fiducap
