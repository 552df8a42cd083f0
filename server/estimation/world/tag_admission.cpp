// How tags come into the world filter's state, and what that makes of the workspace.
#include <algorithm>

#include "base/assert.hpp"
#include "base/so3.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/filter/map_links.hpp"
#include "estimation/world/tag_entry.hpp"
#include "estimation/world/workspace_axes.hpp"
#include "estimation/world/world_filter.hpp"

namespace fiducap::world {

using namespace filter_rules;  // NOLINT: short names for what both filters go by

namespace {

// The reference tag is tied again when linearisation has let it slip this far (m and rad together),
// or when it seems as unsure as that: every image makes it so by a micrometre, which is nothing but
// what tying costs.
constexpr double kSlipped = 1e-6;
constexpr double kUnsure = 1e-5;

}  // namespace

std::optional<CameraAttitude> WorldFilter::camera_attitude(int camera, Instant at) const {
  const Eigen::Quaterniond& q_BV = state_.X_BV[static_cast<std::size_t>(camera)].q;
  if (has_imu()) return CameraAttitude{attitude_.q_LB(at, state_.bias_w) * q_BV};
  if (mode_ == Mode::kRunning) return CameraAttitude{state_.X_WB.q * q_BV};
  return std::nullopt;
}

void WorldFilter::meet_fresh_tags(const TagObservations& seen, UpdateReport& report) {
  if (has_imu() && !attitude_.ready()) return;
  const bool alone = usable_.empty();  // nothing else gives a pose: a thin decision beats none
  Patience patience;
  patience.at_least = alone && !has_imu() ? 1 : kViewsToBelieve;
  patience.forced_after = !alone ? 0 : (has_imu() ? kForceWithImu : kForceWithoutImu);
  decided_.clear();
  const CornerNoise& noise = corner_noise_[static_cast<std::size_t>(seen.camera)];
  for (const TagToUse& tag : fresh_) {
    const auto attitude = camera_attitude(seen.camera, seen.exposed_at);
    const auto verdict =
        candidates_.judge(seen.camera, seen.exposed_at, *tag.seen, model_of(seen.camera),
                          noise.of(*tag.seen), attitude, patience);
    if (verdict) {
      decided_.emplace_back(tag, *verdict);
    } else {
      ++report.tags_pending;
      if (mode_ == Mode::kRunning && has_imu() && tag.known == nullptr)
        memory_.wait(tag.seen->tag_id, attitude->q_WV, state_);
    }
  }
  for (const auto& [tag, verdict] : decided_) {
    if (!admit_late(tag, verdict, report) && !admit(seen, tag, verdict.X_VT, report))
      ++report.tags_pending;
  }
}

Pose WorldFilter::near_place(const TagObservation& seen, int camera,
                             const Eigen::Quaterniond& q_VT) const {
  const auto poses = solve_tag_pose(seen, model_of(camera));
  const bool second = angle_between(poses[1].X_VT.q, q_VT) < angle_between(poses[0].X_VT.q, q_VT);
  return place_turned_tag(seen, model_of(camera), q_VT, poses[second ? 1 : 0].X_VT.p);
}

bool WorldFilter::admit_late(const TagToUse& tag, const TagVerdict& verdict, UpdateReport& report) {
  const int tag_id = tag.seen->tag_id;
  const auto first = memory_.first_sight(tag_id);
  if (!first || !verdict.q_WT || tag.known != nullptr ||
      static_cast<int>(state_.tags.size()) >= config_.max_local_tags) {
    return false;
  }
  ImageMemory::Image& image = memory_.image(first->number);
  const auto seen = std::find_if(image.seen.tags.begin(), image.seen.tags.end(),
                                 [&](const auto& s) { return s.tag_id == tag_id; });
  FIDUCAP_ASSERT(seen != image.seen.tags.end());
  const Eigen::Quaterniond q_VT = first->q_LV.conjugate() * *verdict.q_WT;
  image.admissions.push_back({tag_id, near_place(*seen, image.seen.camera, q_VT)});
  live_again(first->number, report);
  memory_.stop_waiting(tag_id);
  ++report.tags_added;
  return true;
}

void WorldFilter::live_again(long from, UpdateReport& report) {
  state_ = *memory_.state_at(from);
  for (long number = from; number <= memory_.newest(); ++number) {
    ImageMemory::Image& image = memory_.image(number);
    if (number > from) {
      look_at(image.seen);
      sort_tags(image.seen, image.known);
      move_to(image.seen);
      report.exposed_at = image.seen.exposed_at;
      if (!usable_.empty()) correct(image.seen, report, 1);
      if (window_) correct_by_points(image.seen, number, report);
      memory_.renew(number, state_);
    }
    for (const ImageMemory::Admission& admission : image.admissions) join(image.seen, admission);
  }
}

void WorldFilter::join(const TagObservations& seen, const ImageMemory::Admission& admission) {
  const auto tag = std::find_if(seen.tags.begin(), seen.tags.end(),
                                [&](const auto& s) { return s.tag_id == admission.tag_id; });
  augment(state_, seen.camera, model_of(seen.camera), *tag, admission.X_VT,
          corner_noise_[static_cast<std::size_t>(seen.camera)].of(*tag));
  state_.tags.back().first_seen = seen.exposed_at;
  state_.tags.back().last_seen = seen.exposed_at;
  last_used_at_ = seen.exposed_at;
}

bool WorldFilter::admit(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                        UpdateReport& report) {
  if (mode_ == Mode::kAdrift && !admit_adrift(seen, tag, X_VT)) return false;
  if (mode_ == Mode::kStarting) start(seen.exposed_at);
  if (tag.known != nullptr) {
    admit_known(seen, tag, X_VT, report);
    return true;
  }
  if (static_cast<int>(state_.tags.size()) >= config_.max_local_tags) return false;
  const ImageMemory::Admission admission{tag.seen->tag_id, X_VT};
  if (memory_.newest() >= 0) memory_.image(memory_.newest()).admissions.push_back(admission);
  join(seen, admission);
  ++report.tags_added;
  const auto prior = priors_.find(tag.seen->tag_id);
  if (prior != priors_.end()) {
    anchor_at(seen.camera, X_VT, prior->second.X_WT, report);
    fuse_prior(state_, state_.tags.size() - 1, prior->second);
  }
  return true;
}

bool WorldFilter::admit_adrift(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT) {
  // Nothing links this tag to the old ones but a place in the workspace.
  const auto prior = priors_.find(tag.seen->tag_id);
  if (prior != priors_.end() && is_anchored_) {
    const Pose X_BT = state_.X_BV[static_cast<std::size_t>(seen.camera)] * X_VT;
    jump(prior->second.X_WT * X_BT.inverse(), seen.exposed_at);
    return true;
  }
  if (tag.known == nullptr && prior == priors_.end()) return false;
  restart();  // the old tags never learned where the workspace is
  return true;
}

void WorldFilter::admit_known(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                              UpdateReport& report) {
  anchor_at(seen.camera, X_VT, tag.known->X_WT, report);
  usable_.assign(1, tag);
  if (!tag.known->is_exact() && state_.find(tag.known->tag_id) < 0)
    hold(state_, *tag.known, seen.exposed_at);
  usable_.front().local = state_.find(tag.known->tag_id);
  linearisation_.reset();
  correct(seen, report, kFirstIterations);
  score(report);
}

/// A body that knew its tags before the map did stands in axes of its own; those tags say where the
/// workspace is.
void WorldFilter::anchor_by_own_tags(std::span<const KnownTag> known, UpdateReport& report) {
  if (is_anchored_ || mode_ != Mode::kRunning) return;
  std::vector<MapLink> links;
  for (const KnownTag& tag : known) {
    const int own = state_.find(tag.tag_id);
    if (own < 0 || tag.is_own) continue;
    links.push_back({tag.tag_id, &tag, state_.tags[static_cast<std::size_t>(own)].sightings});
  }
  if (links.empty()) return;
  std::stable_sort(links.begin(), links.end(),
                   [](const auto& a, const auto& b) { return a.sightings > b.sightings; });
  if (!find_agreeing_links(state_, has_imu(), links)) return;
  const auto first = static_cast<std::size_t>(state_.find(links.front().tag_id));
  memory_.forget_all();  // its states do not know where the room is
  shift_workspace(tie_local_to_known(state_, first, links.front().map->X_WT, has_imu()), report);
  is_anchored_ = true;
  for (const MapLink& link : links) {
    const auto tag = static_cast<std::size_t>(state_.find(link.tag_id));
    if (link.map->is_exact()) {
      fuse_prior(state_, tag, *link.map);
    } else {
      hold(state_, *link.map, state_.tags[tag].last_seen);
      fuse_with_held(state_, tag, state_.tags.size() - 1);
    }
    state_.remove_tag(tag);  // the map's from now on
  }
}

void WorldFilter::anchor_at(int camera, const Pose& X_VT, const Pose& X_WT, UpdateReport& report) {
  if (is_anchored_) return;
  memory_.forget_all();  // its states do not know where the room is
  shift_workspace(tie_to_known(state_, camera, X_VT, X_WT, has_imu()), report);
  is_anchored_ = true;
}

void WorldFilter::shift_workspace(const Pose& X_new_old, UpdateReport& report) {
  report.gauge_shift = report.gauge_shift ? X_new_old * *report.gauge_shift : X_new_old;
  memory_.move_axes(X_new_old);
  if (!has_imu()) candidates_.forget_all();  // their views were in the old axes
}

void WorldFilter::tie_workspace(UpdateReport& report) {
  if (!is_anchored_ && !state_.tags.empty()) {
    const int wanted = gauge_.reference_tag ? state_.find(*gauge_.reference_tag) : 0;
    if (wanted < 0 || !may_define_workspace_) return;
    const auto tag = static_cast<std::size_t>(wanted);
    heading_rule_ = make_heading_rule(gauge_, state_.tags[tag].X_WT.q);
    gauge_tag_ = state_.tags[tag].tag_id;
    is_anchored_ = true;
    shift_workspace(tie_to_reference(state_, tag, *heading_rule_, has_imu()), report);
    return;
  }
  if (!gauge_tag_) return;
  // Exact by definition, so this only takes back what linearisation let slip.
  const int tag = state_.find(*gauge_tag_);
  if (tag < 0) return;
  const auto i = static_cast<std::size_t>(tag);
  const ReferenceSlack slack = slack_of_reference(state_, i, *heading_rule_, has_imu());
  if (slack.moved > kSlipped || slack.sigma > kUnsure)
    tie_to_reference(state_, i, *heading_rule_, has_imu());
}

}  // namespace fiducap::world
