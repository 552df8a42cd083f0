#include "estimation/robocentric/robocentric_filter.hpp"

#include <algorithm>
#include <cmath>

#include "base/assert.hpp"
#include "base/so3.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/filter/map_links.hpp"
#include "estimation/robocentric/tag_augmentation.hpp"
#include "estimation/start/place_search.hpp"

namespace fiducap::robocentric {

using namespace layout;        // NOLINT: the block names are the subject of this file
using namespace filter_rules;  // NOLINT: short names for what both filters go by

RobocentricFilter::RobocentricFilter(BodySensors sensors, WorkspaceGauge gauge,
                                     EstimatorConfig config)
    : sensors_(std::move(sensors)),
      gauge_(gauge),
      config_(config),
      gate_(chi_square_quantile(8, config.gate_probability)),
      gravity_W_(0, 0, -sensors_.gravity_m_s2),
      candidates_(config),
      imu_(sensors_.imu.value_or(ImuNoise{}), config.max_imu_gap_s, config.motion_accel_m_s2_rtHz) {
  FIDUCAP_ASSERT(!sensors_.cameras.empty());
  restart();
}

const CameraModel& RobocentricFilter::model_of(int camera) const {
  FIDUCAP_ASSERT(camera >= 0 && camera < static_cast<int>(sensors_.cameras.size()));
  return sensors_.cameras[static_cast<std::size_t>(camera)].model;
}

void RobocentricFilter::restart() {
  ++generation_;
  state_ = FilterState{};
  for (const CameraMount& mount : sensors_.cameras) state_.X_BV.push_back(mount.X_BV);
  state_.resize_covariance();
  auto P = state_.P();
  for (int c = 0; config_.estimate_extrinsics && c < state_.cameras(); ++c) {
    const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(c)];
    P.diagonal()
        .segment<3>(layout::extrinsics(c))
        .setConstant(mount.position_sigma_m * mount.position_sigma_m);
    P.diagonal()
        .segment<3>(layout::extrinsics(c) + 3)
        .setConstant(mount.rotation_sigma_rad * mount.rotation_sigma_rad);
  }
  mode_ = Mode::kStarting;
  is_anchored_ = false;
  scores_.clear();
  motion_.restart();
  attitude_.restart();
  candidates_.forget_all();
  heading_rule_.reset();
  gauge_tag_.reset();
  last_used_at_.reset();
  barren_updates_ = 0;
}

void RobocentricFilter::set_tag_priors(std::vector<KnownTag> priors) {
  priors_.clear();
  for (const KnownTag& prior : priors) priors_[prior.tag_id] = prior;
}

void RobocentricFilter::lose_motion() {
  if (mode_ != Mode::kRunning) return;
  mode_ = Mode::kAdrift;
  motion_.restart();
  attitude_.restart();
  candidates_.forget_all();
  return_attempts_ = 0;
}

void RobocentricFilter::start(Instant at) {
  auto P = state_.P();
  P.topRows<kBodySize>().setZero();
  P.leftCols<kBodySize>().setZero();
  state_.time = at;
  state_.p_WB_B.setZero();
  state_.v_WB_B.setZero();
  P.diagonal().segment<3>(kVelocity).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  if (has_imu()) {
    state_.q_WB = attitude_.q_WB(at, state_.bias_w);
    const Eigen::Vector3d up_B = state_.q_WB.conjugate() * Eigen::Vector3d::UnitZ();
    P.block<3, 3>(kAttitude, kAttitude) =
        kStartTilt_rad * kStartTilt_rad * (Eigen::Matrix3d::Identity() - up_B * up_B.transpose());
    P.diagonal().segment<3>(kBiasF).setConstant(kStartBiasF_m_s2 * kStartBiasF_m_s2);
    P.diagonal().segment<3>(kBiasW).setConstant(kStartBiasW_rad_s * kStartBiasW_rad_s);
  } else {
    state_.q_WB.setIdentity();
    P.diagonal().segment<3>(kBiasW).setConstant(kStartRate_rad_s * kStartRate_rad_s);
  }
  motion_.restart();
  mode_ = Mode::kRunning;
  last_used_at_ = at;
}

void RobocentricFilter::propagate(const ImuSample& imu) {
  if (!has_imu()) return;
  const std::optional<ImuSample> before = imu_.newest();
  if (!imu_.push(imu)) return;
  if (before) attitude_.add(*before, state_.bias_w, state_.bias_f);
  if (mode_ != Mode::kRunning) {
    imu_.keep_newest_pair();
  } else if (imu_.is_full()) {
    // No image for long: move on without one. The newest sample may still close an image's
    // interval.
    integrate_to(imu_.before_newest().sampled_at);
    transition_.apply(state_, motion_);
  }
}

void RobocentricFilter::integrate_to(Instant to) {
  if (!has_imu()) {
    InertialInput input;
    input.has_accelerometer = false;
    input.accel_noise = config_.motion_accel_m_s2_rtHz;
    input.gyro_walk = config_.motion_angular_rad_s2_rtHz;
    return step_to(to, input, kStepWithoutImu_s);
  }
  while (state_.time < to) {
    const Instant end = imu_.end_of_interval(state_.time, to);
    step_to(end, imu_.input_between(state_.time, end), kStepWithImu_s);
  }
  imu_.forget_before(to);
}

void RobocentricFilter::step_to(Instant to, const InertialInput& input, double longest_s) {
  while (state_.time < to) {
    const Instant end = std::min(to, state_.time + from_seconds(longest_s));
    robocentric::propagate(state_, motion_, input, gravity_W_, to_seconds(end - state_.time));
    state_.time = end;
  }
}

void RobocentricFilter::sort_tags(const TagObservations& seen, std::span<const KnownTag> known) {
  usable_.clear();
  fresh_.clear();
  for (const TagObservation& tag : seen.tags) {
    const auto given = std::find_if(known.begin(), known.end(),
                                    [&](const KnownTag& k) { return k.tag_id == tag.tag_id; });
    TagToUse use{&tag, state_.find(tag.tag_id), given == known.end() ? nullptr : &*given};
    const bool usable = use.local >= 0 || (use.known != nullptr && is_anchored_);
    (usable ? usable_ : fresh_).push_back(use);
  }
}

UpdateReport RobocentricFilter::update(const TagObservations& seen, const MapKnowledge& map) {
  const std::span<const KnownTag> known = map.tags;
  may_define_workspace_ = map.may_define_workspace;
  UpdateReport report;
  report.exposed_at = seen.exposed_at;
  report.tags_seen = static_cast<int>(seen.tags.size());
  report.running = mode_ == Mode::kRunning;
  report.generation = generation_;
  if (report.running && seen.exposed_at < state_.time)
    return report;  // too late; the merger counts these

  const int generation = generation_;
  anchor_by_own_tags(known, report);
  sort_tags(seen, known);
  const double silent_s = last_used_at_ ? to_seconds(seen.exposed_at - *last_used_at_) : 0.0;
  if (silent_s > (has_imu() ? kAdriftWithImu_s : kAdriftWithoutImu_s)) lose_motion();

  linearisation_.reset();
  bool at_image = false;  // the state stands at this image
  int iterations = 1;
  if (mode_ == Mode::kRunning) {
    at_image = move_to(seen);
    if (linearisation_) iterations = kCornerStepIterations;
  } else if (mode_ == Mode::kAdrift && !usable_.empty()) {
    at_image = come_back(seen);
    iterations = kFirstIterations;
  }
  if (at_image && !usable_.empty()) correct(seen, report, iterations);
  if (linearisation_ && report.tags_used == 0) {
    // The motion that the corners showed was no motion: forget this image.
    state_ = before_;
    at_image = false;
  }
  if (at_image || mode_ == Mode::kStarting || (mode_ == Mode::kAdrift && usable_.empty()))
    meet_fresh_tags(seen, report);
  if (barren_updates_ >= kBarrenToRestart) restart();
  if (mode_ == Mode::kRunning) tie_workspace(report);
  report.running = mode_ == Mode::kRunning;
  report.generation = generation_;
  if (generation_ != generation) report.gauge_shift.reset();  // nothing was given out since
  return report;
}

bool RobocentricFilter::move_to(const TagObservations& seen) {
  if (seen.exposed_at == state_.time) return true;  // another camera of the same instant
  if (!has_imu()) return !usable_.empty() && move_by_corners(seen);
  integrate_to(seen.exposed_at);
  transition_.apply(state_, motion_);
  return true;
}

bool RobocentricFilter::move_by_corners(const TagObservations& seen) {
  const double dt = to_seconds(seen.exposed_at - state_.time);
  const double wander =
      config_.motion_accel_m_s2_rtHz * dt * std::sqrt(dt) + kStartVelocity_m_s * 0.1 * dt + 0.01;
  const double turning = config_.motion_angular_rad_s2_rtHz * dt * std::sqrt(dt) + 0.1 * dt + 0.01;
  const PlaceGuess guess{{exp_so3(-state_.bias_w * dt), state_.v_WB_B * dt}, wander, turning};
  const auto found = find_place(tags_at_start(state_, seen.camera, model_of(seen.camera), usable_),
                                guess, config_.corner_noise_px);
  if (!found) return false;
  before_ = state_;
  // The velocity and rate that lead exactly there are where the motion model is linearised …
  const Eigen::Vector3d v_before = state_.v_WB_B;
  const Eigen::Vector3d bias_before = state_.bias_w;
  state_.v_WB_B = found->X_AB.p / dt;
  state_.bias_w = -log_so3(found->X_AB.q) / dt;
  Eigen::Matrix<double, kBodySize, 1> offset = Eigen::Matrix<double, kBodySize, 1>::Zero();
  offset.segment<3>(kVelocity) = v_before - state_.v_WB_B;
  offset.segment<3>(kBiasW) = bias_before - state_.bias_w;
  integrate_to(seen.exposed_at);
  const Eigen::Matrix<double, kMotionSize, 1> moved = motion_.Phi * offset;
  transition_.apply(state_, motion_);
  linearisation_ = state_;
  // … and the prior mean is where the old velocity and rate would have led.
  state_.add_error(transition_.spread(state_, moved));
  return true;
}

bool RobocentricFilter::come_back(const TagObservations& seen) {
  PlaceGuess guess{Pose{}, kUnknownPosition_m, has_imu() ? kGyroTurn_rad : kUnknownAngle_rad};
  if (has_imu()) {
    if (!attitude_.ready()) return false;
    guess.X_AB.q = attitude_.q_LB(seen.exposed_at, state_.bias_w);
  }
  const auto found = find_place(tags_at_start(state_, seen.camera, model_of(seen.camera), usable_),
                                guess, config_.corner_noise_px);
  ++return_attempts_;
  const bool forced = return_attempts_ >= (has_imu() ? kForceWithImu : kForceWithoutImu);
  if (!found || (found->evidence < config_.branch_evidence && !forced)) return false;

  jump(found->X_AB, seen.exposed_at);
  return true;
}

void RobocentricFilter::jump(const Pose& X_B0B, Instant at) {
  motion_ = step_by_unknown_motion(state_, X_B0B, has_imu());
  transition_.apply(state_, motion_);
  state_.time = at;
  mode_ = Mode::kRunning;
}

void RobocentricFilter::correct(const TagObservations& seen, UpdateReport& report, int iterations) {
  CornerUpdate<FilterState>::Options options{gate_, iterations,
                                             linearisation_ ? &*linearisation_ : nullptr};
  const UpdateReport done = corner_update_.apply(state_, seen.camera, model_of(seen.camera),
                                                 usable_, options, corner_noise_, accepted_);
  report.tags_used = done.tags_used;
  report.tags_rejected = done.tags_rejected;
  report.nis = done.nis;
  report.nis_dof = done.nis_dof;
  report.reprojection_px = done.reprojection_px;
  note_sightings(state_, usable_, accepted_, seen.exposed_at);
  score(report);
}

void RobocentricFilter::score(UpdateReport& report) {
  const bool any = report.tags_used > 0;
  barren_updates_ = any ? 0 : barren_updates_ + 1;
  if (any) last_used_at_ = report.exposed_at;
  for (const int tag_id : scores_.count(usable_, accepted_)) {
    const int tag = state_.find(tag_id);
    if (tag >= 0) state_.remove_tag(static_cast<std::size_t>(tag));
    if (gauge_tag_ == tag_id) gauge_tag_.reset();
    report.name_dropped(tag_id);
  }
}

/// A body that knew its tags before the map did stands in axes of its own; those tags say where the
/// workspace is.
void RobocentricFilter::anchor_by_own_tags(std::span<const KnownTag> known, UpdateReport& report) {
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
  shift_workspace(tie_local_to_known(state_, first, links.front().map->X_WT, has_imu()), report);
  is_anchored_ = true;
  for (const MapLink& link : links) {
    const auto tag = static_cast<std::size_t>(state_.find(link.tag_id));
    fuse_prior(state_, tag, *link.map);
    state_.remove_tag(tag);  // the map's from now on
  }
}

std::optional<CameraAttitude> RobocentricFilter::camera_attitude(int camera, Instant at) const {
  const Eigen::Quaterniond& q_BV = state_.X_BV[static_cast<std::size_t>(camera)].q;
  if (has_imu()) return CameraAttitude{attitude_.q_LB(at, state_.bias_w) * q_BV};
  if (mode_ == Mode::kRunning) return CameraAttitude{state_.q_WB * q_BV};
  return std::nullopt;
}

void RobocentricFilter::meet_fresh_tags(const TagObservations& seen, UpdateReport& report) {
  if (has_imu() && !attitude_.ready()) return;
  const bool alone = usable_.empty();  // nothing else gives a pose: a thin decision beats none
  const int at_least = alone && !has_imu() ? 1 : kViewsToBelieve;
  const int forced_after = !alone ? 0 : (has_imu() ? kForceWithImu : kForceWithoutImu);
  for (const TagToUse& tag : fresh_) {
    const auto attitude = camera_attitude(seen.camera, seen.exposed_at);
    const auto verdict = candidates_.judge(
        seen.camera, seen.exposed_at, *tag.seen, model_of(seen.camera), corner_noise_.of(*tag.seen),
        attitude, {.at_least = at_least, .forced_after = forced_after});
    if (!verdict || !admit(seen, tag, verdict->X_VT, report)) ++report.tags_pending;
  }
}

bool RobocentricFilter::admit(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                              UpdateReport& report) {
  if (mode_ == Mode::kAdrift) {
    // Nothing links this tag to the old ones but a place in the workspace.
    const auto prior = priors_.find(tag.seen->tag_id);
    if (prior != priors_.end() && is_anchored_) {
      const Pose X_BT = state_.X_BV[static_cast<std::size_t>(seen.camera)] * X_VT;
      jump(state_.X_WB().inverse() * prior->second.X_WT * X_BT.inverse(), seen.exposed_at);
    } else if (tag.known != nullptr || prior != priors_.end()) {
      restart();  // the old tags never learned where the workspace is
    } else {
      return false;
    }
  }
  if (mode_ == Mode::kStarting) start(seen.exposed_at);
  if (tag.known != nullptr) {
    if (!is_anchored_) {
      shift_workspace(tie_to_known(state_, seen.camera, X_VT, tag.known->X_WT, has_imu()), report);
      is_anchored_ = true;
    }
    usable_.assign(1, tag);
    usable_.front().local = -1;
    linearisation_.reset();
    correct(seen, report, kFirstIterations);
    return true;
  }
  if (static_cast<int>(state_.tags.size()) >= config_.max_local_tags) return false;
  augment(state_, seen.camera, model_of(seen.camera), *tag.seen, X_VT, config_.corner_noise_px);
  state_.tags.back().first_seen = seen.exposed_at;
  state_.tags.back().last_seen = seen.exposed_at;
  ++report.tags_added;
  last_used_at_ = seen.exposed_at;
  apply_priors(seen.camera, tag.seen->tag_id, X_VT, report);
  return true;
}

void RobocentricFilter::apply_priors(int camera, int tag_id, const Pose& X_VT,
                                     UpdateReport& report) {
  const auto prior = priors_.find(tag_id);
  if (prior == priors_.end()) return;
  if (!is_anchored_) {
    shift_workspace(tie_to_known(state_, camera, X_VT, prior->second.X_WT, has_imu()), report);
    is_anchored_ = true;
  }
  fuse_prior(state_, state_.tags.size() - 1, prior->second);
}

void RobocentricFilter::shift_workspace(const Pose& X_new_old, UpdateReport& report) {
  report.gauge_shift = report.gauge_shift ? X_new_old * *report.gauge_shift : X_new_old;
  if (!has_imu()) candidates_.forget_all();  // their views were in the old axes
}

void RobocentricFilter::tie_workspace(UpdateReport& report) {
  if (!is_anchored_ && !state_.tags.empty()) {
    const int wanted = gauge_.reference_tag ? state_.find(*gauge_.reference_tag) : 0;
    if (wanted < 0 || !may_define_workspace_) return;
    const auto tag = static_cast<std::size_t>(wanted);
    heading_rule_ = make_heading_rule(gauge_, tag_in_workspace(state_, tag).X_WT.q);
    gauge_tag_ = state_.tags[tag].tag_id;
    is_anchored_ = true;
    shift_workspace(tie_to_reference(state_, tag, *heading_rule_, has_imu()), report);
    return;
  }
  if (!gauge_tag_) return;
  // Exact by definition, so this only takes back what linearisation let slip.
  const int tag = state_.find(*gauge_tag_);
  if (tag >= 0) tie_to_reference(state_, static_cast<std::size_t>(tag), *heading_rule_, has_imu());
}

BodyEstimate RobocentricFilter::estimate() const {
  FIDUCAP_ASSERT(running());
  BodyEstimate out = body_in_workspace(state_);
  out.anchored = is_anchored_;
  out.w_WB_B = -state_.bias_w;
  if (has_imu() && imu_.newest()) {
    const InertialInput input = imu_.input_between(state_.time, state_.time);
    out.w_WB_B = input.w_B - state_.bias_w;
    out.a_WB = state_.q_WB * (input.f_B - state_.bias_f) + gravity_W_;
  }
  return out;
}

void RobocentricFilter::tag_beliefs(std::vector<TagBelief>& out) const {
  out.clear();
  if (mode_ == Mode::kStarting) return;
  const int component = is_anchored_ ? TagBelief::kWorkspace : TagBelief::kOwnAxes;
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    const LocalTag& tag = state_.tags[i];
    out.push_back(
        {tag_in_workspace(state_, i), tag.sightings, tag.first_seen, tag.last_seen, component});
  }
}

std::vector<ExtrinsicsEstimate> RobocentricFilter::extrinsics() const {
  std::vector<ExtrinsicsEstimate> out;
  for (int c = 0; c < state_.cameras(); ++c) {
    out.push_back({state_.X_BV[static_cast<std::size_t>(c)],
                   state_.P().block<6, 6>(layout::extrinsics(c), layout::extrinsics(c)),
                   {}});
  }
  return out;
}

}  // namespace fiducap::robocentric
