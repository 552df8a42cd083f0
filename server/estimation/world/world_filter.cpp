#include "estimation/world/world_filter.hpp"

#include <algorithm>
#include <cmath>

#include "base/assert.hpp"
#include "base/so3.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/world/tag_entry.hpp"
#include "estimation/world/workspace_axes.hpp"

namespace fiducap::world {

using namespace layout;        // NOLINT: the block names are the subject of this file
using namespace filter_rules;  // NOLINT: short names for what both filters go by

namespace {

// Map tags are held while in view, and so many more of those seen last: what their errors share
// with the body's is worth keeping for a while, and a hall of a thousand tags costs what a room of
// ten does.
constexpr std::size_t kHeldOutOfView = 12;
// The map has another place for a tag that moved more than this, or whose variance changed by this
// share.
constexpr double kSamePlace = 1e-9;
constexpr double kSameVariance = 0.01;

bool is_in_view(const TagObservations& seen, int tag_id) {
  return std::any_of(seen.tags.begin(), seen.tags.end(),
                     [&](const auto& s) { return s.tag_id == tag_id; });
}

bool is_news(const FilterState& state, std::size_t i, const KnownTag& now) {
  const Pose& X_WT = state.tags[i].X_WT;
  if ((X_WT.p - now.X_WT.p).norm() > kSamePlace || angle_between(X_WT.q, now.X_WT.q) > kSamePlace)
    return true;
  const Matrix6d held = tag_in_workspace(state, i).covariance;
  return (held - now.covariance).norm() > kSameVariance * held.norm();
}

}  // namespace

WorldFilter::WorldFilter(BodySensors sensors, WorkspaceGauge gauge, EstimatorConfig config)
    : sensors_(std::move(sensors)),
      gauge_(gauge),
      config_(config),
      gate_(chi_square_quantile(8, config.gate_probability)),
      gravity_W_(0, 0, -sensors_.gravity_m_s2),
      candidates_(config),
      imu_(sensors_.imu.value_or(ImuNoise{}), config.max_imu_gap_s, config.motion_accel_m_s2_rtHz) {
  FIDUCAP_ASSERT(!sensors_.cameras.empty());
  if (config_.landmarks && has_imu()) window_.emplace(sensors_.cameras.size(), LandmarkRules{});
  corner_noise_.assign(sensors_.cameras.size(), CornerNoise(config, config.learn_corner_noise));
  restart();
}

const CameraModel& WorldFilter::model_of(int camera) const {
  FIDUCAP_ASSERT(camera >= 0 && camera < static_cast<int>(sensors_.cameras.size()));
  return sensors_.cameras[static_cast<std::size_t>(camera)].model;
}

void WorldFilter::restart() {
  if (!reliving_) {
    begin_log();
    ++generation_;
  }
  std::vector<Pose> X_BV;
  for (const CameraMount& mount : sensors_.cameras) X_BV.push_back(mount.X_BV);
  state_.reset(std::move(X_BV), window_ ? CloneWindow::kClones : 0);
  for (int c = 0; c < state_.cameras(); ++c) restart_camera(c);
  mode_ = Mode::kStarting;
  is_anchored_ = false;
  scores_.clear();
  motion_.restart();
  attitude_.restart();
  candidates_.forget_all();
  memory_.forget_all();
  heading_rule_.reset();
  gauge_tag_.reset();
  last_used_at_.reset();
  is_attitude_lost_ = false;
  barren_updates_ = 0;
  strained_updates_ = 0;
}

void WorldFilter::restart_camera(int camera) {
  const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(camera)];
  auto P = state_.P();
  if (config_.estimate_extrinsics) {
    Matrix6d plain = Matrix6d::Zero();
    plain.diagonal().head<3>().setConstant(mount.position_sigma_m * mount.position_sigma_m);
    plain.diagonal().tail<3>().setConstant(mount.rotation_sigma_rad * mount.rotation_sigma_rad);
    const Matrix6d J = world_from_plain_error(mount.X_BV.p);
    P.block<6, 6>(layout::camera(camera), layout::camera(camera)) =
        J * plain * J.transpose();  // the body is at the origin
  }
  const auto k = static_cast<std::size_t>(camera);
  state_.clocks[k] = {.shift_s = life_.shifts_s[k], .readout_s = mount.readout_s};
  // Without an IMU there is no other clock to compare with.
  if (!config_.estimate_clocks || !has_imu()) return;
  P(layout::clock(camera) + 1, layout::clock(camera) + 1) =
      mount.readout_sigma_s * mount.readout_sigma_s;
  open_clock(camera, life_.sigma_s(mount.time_shift_sigma_s));
}

void WorldFilter::release_tag(int tag_id) {
  const int tag = state_.find(tag_id);
  if (tag < 0 || gauge_tag_ == tag_id || mode_ != Mode::kRunning || !is_anchored_) return;
  state_.remove_tag(static_cast<std::size_t>(tag));
  memory_.forget_all();  // its states still hold the tag
}

void WorldFilter::set_tag_priors(std::vector<KnownTag> priors) {
  priors_.clear();
  for (const KnownTag& prior : priors) priors_[prior.tag_id] = prior;
}

bool WorldFilter::running() const {
  return mode_ == Mode::kRunning && (is_anchored_ || !state_.tags.empty());
}

void WorldFilter::start(Instant at) {
  camera_errors_to_extrinsics(state_);
  auto P = state_.P();
  P.topRows<kBodySize>().setZero();
  P.leftCols<kBodySize>().setZero();
  state_.time = at;
  state_.X_WB = Pose{};
  state_.v_WB.setZero();
  P.diagonal().segment<3>(kVelocity).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  if (has_imu()) {
    state_.X_WB.q = attitude_.q_WB(at, state_.bias_w);
    P.diagonal().segment<2>(kAttitude).setConstant(kStartTilt_rad * kStartTilt_rad);
    P.diagonal().segment<3>(kBiasF).setConstant(kStartBiasF_m_s2 * kStartBiasF_m_s2);
    P.diagonal().segment<3>(kBiasW).setConstant(kStartBiasW_rad_s * kStartBiasW_rad_s);
  } else {
    P.diagonal().segment<3>(kBiasW).setConstant(kStartRate_rad_s * kStartRate_rad_s);
  }
  extrinsics_to_camera_errors(state_);
  motion_.restart();
  mode_ = Mode::kRunning;
  last_used_at_ = at;
}

void WorldFilter::propagate(const ImuSample& imu) {
  if (!has_imu()) return;
  start_log_.add(imu);
  const std::optional<ImuSample> before = imu_.newest();
  if (!imu_.push(imu)) return;
  if (before) attitude_.add(*before, state_.bias_w, state_.bias_f);
  if (mode_ == Mode::kAdrift && imu_.is_gyro_blind()) {
    is_attitude_lost_ = true;
    attitude_.restart();
    candidates_.forget_all();
  }
  if (mode_ != Mode::kRunning) {
    imu_.keep_newest_pair();
  } else if (imu_.is_full()) {
    // No image for long: move on without one. The newest sample may still close an image's
    // interval.
    integrate_to(imu_.before_newest().sampled_at);
    apply(state_, motion_);
  }
}

void WorldFilter::integrate_to(Instant to) {
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
  imu_.forget_before(memory_.needed_since().value_or(to));
}

void WorldFilter::step_to(Instant to, const InertialInput& input, double longest_s) {
  while (state_.time < to) {
    const Instant end = std::min(to, state_.time + from_seconds(longest_s));
    world::propagate(state_, motion_, input, gravity_W_, to_seconds(end - state_.time));
    state_.time = end;
  }
}

/// What the map says of the tags that are held.
void WorldFilter::follow_map(const TagObservations& seen, std::span<const KnownTag> known) {
  for (std::size_t i = state_.tags.size(); i-- > 0;) {
    const WorldTag& tag = state_.tags[i];
    if (!tag.held) continue;
    const auto now = std::find_if(known.begin(), known.end(),
                                  [&](const KnownTag& k) { return k.tag_id == tag.tag_id; });
    if (now == known.end()) {
      if (is_in_view(seen, tag.tag_id)) state_.remove_tag(i);  // the map does not stand by it
    } else if (is_news(state_, i, *now)) {
      const bool is_moved = !replace_held(state_, i, *now);
      if (is_moved || now->is_exact()) state_.remove_tag(i);
    }
  }
}

void WorldFilter::hold_map_tags(const TagObservations& seen, std::span<const KnownTag> known) {
  follow_map(seen, known);
  if (is_anchored_) {
    for (const KnownTag& tag : known) {
      if (is_in_view(seen, tag.tag_id) && !tag.is_exact() && state_.find(tag.tag_id) < 0)
        hold(state_, tag, seen.exposed_at);
    }
  }
  for (;;) {
    std::size_t out_of_view = 0;
    std::size_t oldest = state_.tags.size();
    for (std::size_t i = 0; i < state_.tags.size(); ++i) {
      if (!state_.tags[i].held || is_in_view(seen, state_.tags[i].tag_id)) continue;
      ++out_of_view;
      if (oldest == state_.tags.size() || state_.tags[i].last_seen < state_.tags[oldest].last_seen)
        oldest = i;
    }
    if (out_of_view <= kHeldOutOfView) return;
    state_.remove_tag(oldest);
  }
}

void WorldFilter::sort_tags(const TagObservations& seen, std::span<const KnownTag> known) {
  usable_.clear();
  fresh_.clear();
  hold_map_tags(seen, known);
  for (const TagObservation& tag : seen.tags) {
    const auto given = std::find_if(known.begin(), known.end(),
                                    [&](const KnownTag& k) { return k.tag_id == tag.tag_id; });
    TagToUse use{&tag, state_.find(tag.tag_id), given == known.end() ? nullptr : &*given};
    const bool usable = use.local >= 0 || (use.known != nullptr && is_anchored_);
    (usable ? usable_ : fresh_).push_back(use);
  }
}

std::vector<SightedTag> WorldFilter::sighted(int camera) const {
  std::vector<SightedTag> out;
  for (const TagToUse& tag : usable_) {
    out.push_back({tag.seen, &model_of(camera), state_.X_BV[static_cast<std::size_t>(camera)],
                   place_of(state_, tag)});
  }
  return out;
}

UpdateReport WorldFilter::update(const TagObservations& seen, const MapKnowledge& map) {
  may_define_workspace_ = map.may_define_workspace;
  log_start(seen, map.tags);
  const int generation = generation_;
  const Axes before{is_anchored_, gauge_tag_};
  UpdateReport report = relive_start_if_due(process(seen, map.tags), before);
  report.generation = generation_;
  if (generation_ != generation) report.gauge_shift.reset();  // nothing was given out since
  return report;
}

UpdateReport WorldFilter::process(const TagObservations& seen, std::span<const KnownTag> known) {
  UpdateReport report;
  report.exposed_at = seen.exposed_at;
  report.tags_seen = static_cast<int>(seen.tags.size());
  report.running = running();
  if (mode_ == Mode::kRunning && seen.exposed_at < state_.time)
    return report;  // too late; the merger counts these

  look_at(seen);
  anchor_by_own_tags(known, report);
  sort_tags(seen, known);
  const double silent_s = last_used_at_ ? to_seconds(seen.exposed_at - *last_used_at_) : 0.0;
  if (silent_s > (has_imu() ? kAdriftWithImu_s : kAdriftWithoutImu_s)) lose_motion();

  linearisation_.reset();
  // With gravity and gyro the motion is followed from the first sight of a tag on, before any tag
  // has joined.
  if (mode_ == Mode::kStarting && attitude_.ready() && !fresh_.empty()) start(seen.exposed_at);
  bool at_image = false;  // the state stands at this image
  int iterations = 1;
  if (mode_ == Mode::kRunning) {
    at_image = move_to(seen);
    if (linearisation_) iterations = kCornerStepIterations;
    if (at_image && has_turned_blindly()) {
      lose_motion();
      is_attitude_lost_ = mode_ == Mode::kAdrift;
      at_image = false;
    }
  }
  if (mode_ == Mode::kAdrift) {
    at_image = !usable_.empty() && come_back(seen);
    iterations = kFirstIterations;
  }
  if (at_image && !usable_.empty()) {
    correct(seen, report, iterations);
    score(report);
  }
  if (linearisation_ && report.tags_used == 0) {
    // The motion that the corners showed was no motion: forget this image.
    state_ = before_;
    at_image = false;
  }
  if (at_image) memory_.add(seen, known);
  if (at_image && window_) correct_by_points(seen, memory_.newest(), report);
  if (at_image || mode_ == Mode::kStarting || (mode_ == Mode::kAdrift && usable_.empty()))
    meet_fresh_tags(seen, report);
  answer_contradictions(seen);
  if (mode_ == Mode::kRunning) tie_workspace(report);
  report.running = running();
  charge(seen, report);
  return report;
}

void WorldFilter::answer_contradictions(const TagObservations& seen) {
  // A young filter that contradicts itself lives its start again; an old one had a good clock,
  // which must have jumped.
  if (strained_updates_ == kStrainedToReopenClock && !start_log_.is_open() && !reliving_)
    reopen_clock(seen.camera);
  if (barren_updates_ < kBarrenToRestart) return;
  const bool is_patient =
      last_used_at_ && to_seconds(seen.exposed_at - *last_used_at_) < kOneTagPatience_s;
  if (!is_patient || !is_one_tag_against_all()) restart();
}

bool WorldFilter::move_to(const TagObservations& seen) {
  if (seen.exposed_at == state_.time) return true;  // another camera of the same instant
  if (!has_imu()) return !usable_.empty() && move_by_corners(seen);
  integrate_to(seen.exposed_at);
  apply(state_, motion_);
  return true;
}

bool WorldFilter::move_by_corners(const TagObservations& seen) {
  const double dt = to_seconds(seen.exposed_at - state_.time);
  const double wander =
      config_.motion_accel_m_s2_rtHz * dt * std::sqrt(dt) + kStartVelocity_m_s * 0.1 * dt + 0.01;
  const double turning = config_.motion_angular_rad_s2_rtHz * dt * std::sqrt(dt) + 0.1 * dt + 0.01;
  const Pose expected{state_.X_WB.q * exp_so3(-state_.bias_w * dt),
                      state_.X_WB.p + state_.v_WB * dt};
  const auto found =
      find_place(sighted(seen.camera), {expected, wander, turning}, config_.corner_noise_px);
  if (!found) return false;
  before_ = state_;
  // The velocity and rate that lead exactly there are where the motion model is linearised …
  Eigen::Matrix<double, kBodySize, 1> offset = Eigen::Matrix<double, kBodySize, 1>::Zero();
  const Eigen::Vector3d v_found = (found->X_AB.p - state_.X_WB.p) / dt;
  const Eigen::Vector3d bias_found = -log_so3(state_.X_WB.q.conjugate() * found->X_AB.q) / dt;
  offset.segment<3>(kVelocity) = state_.v_WB - v_found;
  offset.segment<3>(kBiasW) = state_.bias_w - bias_found;
  state_.v_WB = v_found;
  state_.bias_w = bias_found;
  integrate_to(seen.exposed_at);
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(state_.size());
  moved.head<kBodySize>() = motion_.Phi * offset;
  for (int c = 0; c < state_.cameras(); ++c)
    moved.segment<6>(layout::camera(c)) = moved.segment<6>(kPosition);
  apply(state_, motion_);
  linearisation_ = state_;
  // … and the prior mean is where the old velocity and rate would have led.
  state_.add_error(moved);
  return true;
}

void WorldFilter::correct(const TagObservations& seen, UpdateReport& report, int iterations) {
  const auto camera = static_cast<std::size_t>(seen.camera);
  CornerUpdate<FilterState>::Options options{gate_, iterations,
                                             linearisation_ ? &*linearisation_ : nullptr};
  const UpdateReport done =
      corner_update_.apply(state_, seen.camera, model_of(seen.camera), usable_, options,
                           corner_noise_[camera], accepted_);
  report.tags_used = done.tags_used;
  report.tags_rejected = done.tags_rejected;
  report.nis = done.nis;
  report.nis_dof = done.nis_dof;
  report.reprojection_px = done.reprojection_px;
  note_sightings(state_, usable_, accepted_, seen.exposed_at);
}

void WorldFilter::correct_by_points(const TagObservations& seen, long image, UpdateReport& report) {
  const CameraClock& clock = state_.clocks[static_cast<std::size_t>(seen.camera)];
  // A clone is one moment: not for images whose rows are exposed in turn.
  if (seen.points.size() < kFewestPoints || clock.readout_s != 0) return;
  CloneWindow::clone(state_, seen.camera, image);
  const LandmarkReport done = window_->correct(state_, memory_, model_of(seen.camera), seen.camera);
  report.landmarks_used = done.used;
  report.landmarks_rejected = done.rejected;
  report.landmark_nis = done.nis;
  report.landmark_nis_dof = done.nis_dof;
  if (done.used >= kLandmarksToStay) last_used_at_ = seen.exposed_at;
}

void WorldFilter::score(UpdateReport& report) {
  const bool any = report.tags_used > 0;
  barren_updates_ = any ? 0 : barren_updates_ + 1;
  strained_updates_ = report.tags_used > report.tags_rejected ? 0 : strained_updates_ + 1;
  if (any) last_used_at_ = report.exposed_at;
  for (const int tag_id : scores_.count(usable_, accepted_)) {
    const int tag = state_.find(tag_id);
    if (tag >= 0) state_.remove_tag(static_cast<std::size_t>(tag));
    memory_.forget_tag(tag_id);
    if (gauge_tag_ == tag_id) gauge_tag_.reset();
    report.name_dropped(tag_id);
  }
}

BodyEstimate WorldFilter::estimate() const {
  FIDUCAP_ASSERT(running());
  BodyEstimate out = body_in_workspace(state_);
  out.anchored = is_anchored_;
  out.w_WB_B = -state_.bias_w;
  if (has_imu() && imu_.newest()) {
    const InertialInput input = imu_.input_between(state_.time, state_.time);
    out.w_WB_B = input.w_B - state_.bias_w;
    out.a_WB = state_.X_WB.q * (input.f_B - state_.bias_f) + gravity_W_;
  }
  return out;
}

void WorldFilter::tag_beliefs(std::vector<TagBelief>& out) const {
  out.clear();
  if (start_log_.is_open()) return;  // a start may be taken back, the map's knowledge not
  const int component = is_anchored_ ? TagBelief::kWorkspace : TagBelief::kOwnAxes;
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    const WorldTag& tag = state_.tags[i];
    if (tag.held) continue;
    out.push_back(
        {tag_in_workspace(state_, i), tag.sightings, tag.first_seen, tag.last_seen, component});
  }
}

std::vector<ExtrinsicsEstimate> WorldFilter::extrinsics() const {
  std::vector<ExtrinsicsEstimate> out;
  for (int c = 0; c < state_.cameras(); ++c) {
    out.push_back(
        {state_.X_BV[static_cast<std::size_t>(c)], extrinsics_covariance(state_, c), clock(c)});
  }
  return out;
}

}  // namespace fiducap::world
