#include "estimation/world/world_coordinates.hpp"

#include <algorithm>

#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"

namespace fiducap::world {

using namespace layout;        // NOLINT: block names
using namespace filter_rules;  // NOLINT: short names

namespace {
constexpr double kUnknownTurn_rad = 0.4;  // of the attitude, 1-sigma
constexpr double kNisShare = 0.02;
constexpr int kUnfitToLearnFrom = 3;  // more consecutive images without a fit are no noise
constexpr double kExactReadout_s = 5.1e-5;
// Slip and sigma of the reference tag at which it redefines W: m and rad.
constexpr double kSlipped = 1e-6;
constexpr double kUnsure = 1e-5;
}  // namespace

WorldCoordinates::WorldCoordinates(const BodySensors& sensors, const EstimatorConfig& config)
    : sensors_(sensors),
      config_(config),
      gravity_W_(0, 0, -sensors.gravity_m_s2),
      // Without an IMU the parameters cannot be distinguished.
      calibration_monitor_(sensors.cameras,
                           {.doubts = config.doubt_configuration && sensors.imu.has_value(),
                            .refines = config.refine_intrinsics,
                            .assumes = config.doubt_configuration && !sensors.imu}) {
  if (config.landmarks && sensors.imu) window_.emplace(sensors.cameras.size(), LandmarkRules{});
  for (const CameraMount& mount : sensors.cameras) {
    lenses_.push_back(mount.model);
    corner_noise_.emplace_back(config, config.learn_corner_noise, &mount);
  }
}

void WorldCoordinates::reset(const ClockHypothesis& clocks) {
  std::vector<Pose> X_BV;
  for (const CameraMount& mount : sensors_.cameras) X_BV.push_back(mount.X_BV);
  state_.reset(std::move(X_BV), window_ ? CloneWindow::kClones : 0);
  const int cameras = state_.cameras();
  for (int c = 0; c < cameras; ++c) reset_camera(c, clocks);
  if (sensors_.imu) state_.clear_column(gravity(cameras), sensors_.gravity_sigma_m_s2);
  calibration_monitor_.begin(state_);
  noise_watch_.restart();
  nis_ = 1;
  motion_.restart();
  memory_.forget_all();
  held_tags_ = {};
}

void WorldCoordinates::reset_camera(int camera, const ClockHypothesis& clocks) {
  const auto k = static_cast<std::size_t>(camera);
  const CameraMount& mount = sensors_.cameras[k];
  auto P = state_.P();
  if (config_.estimate_extrinsics) {
    Matrix6d plain = Matrix6d::Zero();
    plain.diagonal().head<3>().setConstant(mount.position_sigma_m * mount.position_sigma_m);
    plain.diagonal().tail<3>().setConstant(mount.rotation_sigma_rad * mount.rotation_sigma_rad);
    const Matrix6d J = world_from_plain_error(mount.X_BV.p);
    P.block<6, 6>(layout::camera(camera), layout::camera(camera)) =
        J * plain * J.transpose();  // the body is at the origin
  }
  state_.clocks[k] = {.shift_s = clocks.shifts_s[k],
                      .readout_s = mount.readout_s,
                      .rows_apart = mount.readout_s != 0 || mount.readout_sigma_s != 0};
  // Without an IMU there is no reference clock.
  if (!config_.estimate_clocks || !sensors_.imu) return;
  P(layout::clock(camera) + 1, layout::clock(camera) + 1) =
      mount.readout_sigma_s * mount.readout_sigma_s;
  open_clock(camera, clocks.sigma_s(mount.time_shift_sigma_s));
}

void WorldCoordinates::open_clock(int camera, double sigma_s) {
  if (!config_.estimate_clocks || !sensors_.imu) return;
  state_.clear_column(layout::clock(camera), sigma_s);
}

ClockEstimate WorldCoordinates::clock(int camera) const {
  const CameraClock& clock = state_.clocks[static_cast<std::size_t>(camera)];
  const int at = layout::clock(camera);
  const double readout_sigma_s = std::sqrt(state_.P()(at + 1, at + 1));
  // As configured.
  const bool is_exact = !clock.rows_apart && readout_sigma_s < kExactReadout_s;
  return {clock.shift_s, std::sqrt(state_.P()(at, at)), is_exact ? 0.0 : clock.readout_s,
          is_exact ? 0.0 : readout_sigma_s};
}

BodyEstimate WorldCoordinates::body() const {
  BodyEstimate out = body_in_workspace(state_);
  const Matrix6d J = plain_from_world_error(out.X_WB.p);
  out.covariance.topLeftCorner<6, 6>() +=
      J * calibration_monitor_.unmodelled_covariance(state_) * J.transpose();
  out.covariance *= noise_watch_.variance_inflation();
  return out;
}

bool WorldCoordinates::is_attitude_unknown() const {
  return state_.P().diagonal().segment<3>(kAttitude).maxCoeff() >
         kUnknownTurn_rad * kUnknownTurn_rad;
}

void WorldCoordinates::start(Instant at, const std::optional<Eigen::Quaterniond>& q_WB) {
  camera_errors_to_extrinsics(state_);
  auto P = state_.P();
  P.topRows<kBodySize>().setZero();
  P.leftCols<kBodySize>().setZero();
  state_.time = at;
  state_.X_WB = Pose{};
  state_.v_WB.setZero();
  P.diagonal().segment<3>(kVelocity).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  if (q_WB) {
    state_.X_WB.q = *q_WB;
    P.diagonal().segment<2>(kAttitude).setConstant(kStartTilt_rad * kStartTilt_rad);
    P.diagonal().segment<3>(kBiasF).setConstant(kStartBiasF_m_s2 * kStartBiasF_m_s2);
    P.diagonal().segment<3>(kBiasW).setConstant(kStartBiasW_rad_s * kStartBiasW_rad_s);
  } else {
    P.diagonal().segment<3>(kBiasW).setConstant(kStartRate_rad_s * kStartRate_rad_s);
  }
  extrinsics_to_camera_errors(state_);
  motion_.restart();
}

void WorldCoordinates::step(const InertialInput& input, double dt) {
  InertialInput noisy = input;
  noisy.scale_noise(std::sqrt(noise_watch_.imu_variance()));
  world::propagate(state_, motion_, noisy, gravity_W_, dt);
}

void WorldCoordinates::finish_motion() {
  if (watches_noise()) noise_watch_.follow(motion_);
  apply(state_, motion_);
}

void WorldCoordinates::lose_motion() {
  motion_.restart();
  noise_watch_.lose_motion();
  memory_.forget_all();
  state_.forget_clones();
}

BodyPlace WorldCoordinates::place() const {
  const auto J = plain_from_world_error(state_.X_WB.p).topRows<3>().eval();
  const Matrix6d own =
      state_.P().topLeftCorner<6, 6>() + calibration_monitor_.unmodelled_covariance(state_);
  return {state_.X_WB.p, J * own * J.transpose()};
}

double WorldCoordinates::turn_sigma_rad() const {
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

void WorldCoordinates::jump(const Pose& X_AB, Instant at) {
  forget_motion(state_, X_AB, sensors_.imu.has_value());
  noise_watch_.lose_motion();
  motion_.restart();
  state_.time = at;
}

void WorldCoordinates::aim(const Pose& X_B0B, double dt) {
  before_ = state_;
  aimed_off_.setZero();
  const Eigen::Vector3d v_found = state_.X_WB.q * X_B0B.p / dt;
  const Eigen::Vector3d bias_found = -log_so3(X_B0B.q) / dt;
  aimed_off_.segment<3>(kVelocity) = state_.v_WB - v_found;
  aimed_off_.segment<3>(kBiasW) = state_.bias_w - bias_found;
  state_.v_WB = v_found;
  state_.bias_w = bias_found;
}

void WorldCoordinates::finish_aimed_motion() {
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(state_.size());
  moved.head<kBodySize>() = motion_.Phi * aimed_off_;
  for (int c = 0; c < state_.cameras(); ++c)
    moved.segment<6>(layout::camera(c)) = moved.segment<6>(kPosition);
  apply(state_, motion_);
  linearisation_ = state_;
  state_.add_error(moved);
}

void WorldCoordinates::look_at(const TagObservations& seen) {
  const auto camera = static_cast<std::size_t>(seen.camera);
  state_.clocks[camera].applied_s = to_seconds(seen.clock_shift);
  lenses_[camera] = state_.lenses[camera].applied_to(model_of(seen.camera));
}

void WorldCoordinates::moved_axes(const Pose& X_new_old) {
  memory_.move_axes(X_new_old);
  noise_watch_.lose_motion();  // covariance in the old axes
}

std::optional<Pose> WorldCoordinates::follow_map(const KnownMap& map, int body_id) {
  if (!held_tags_.has_changed(map)) return std::nullopt;  // most images
  const auto statistics = calibration_monitor_.test_statistics(state_);
  const auto moved = held_tags_.take_over(state_, map, sensors_.imu.has_value());
  if (!moved) return moved;
  calibration_monitor_.restore_test_statistics(state_, statistics);
  if (calibration_monitor_.follow_map(state_, map, body_id)) noise_watch_.unlearn();
  apply_jitter();
  holdoff_.note(*moved, state_.X_WB, state_.time);
  memory_.forget_all();
  state_.forget_clones();
  noise_watch_.lose_motion();  // covariance in the old axes
  return moved;
}

void WorldCoordinates::give_to_map(std::size_t tag, const KnownTag& map) {
  if (map.is_exact()) {
    fuse_prior(state_, tag, map);
  } else {
    hold(state_, map, state_.tags[tag].last_seen);
    fuse_with_held(state_, tag, state_.tags.size() - 1);
  }
  state_.remove_tag(tag);
}

std::vector<SightedTag> WorldCoordinates::sighted(int camera,
                                                  std::span<const TagToUse> tags) const {
  std::vector<SightedTag> out;
  for (const TagToUse& tag : tags) {
    out.push_back({tag.seen, &lenses_[static_cast<std::size_t>(camera)],
                   state_.X_BV[static_cast<std::size_t>(camera)], place_of(state_, tag),
                   state_.lenses[static_cast<std::size_t>(camera)].k1});
  }
  return out;
}

UpdateReport WorldCoordinates::correct(const TagObservations& seen, std::span<const TagToUse> tags,
                                       double gate, int iterations, std::vector<bool>& accepted) {
  const auto camera = static_cast<std::size_t>(seen.camera);
  const bool watches = watches_noise();
  const bool learns =
      watches && !holdoff_.active(state_.time) && teaches_of_noise(state_, seen.camera, tags);
  const double seconds = state_.clocks[camera].seconds_to(0);
  const Vector6d on_time = camera_at(state_, seen.camera, seconds).on_time;
  if (!sensors_.imu) calibration_monitor_.hold_parameters(state_, tags.size());
  if (!sensors_.imu && linearisation_)
    calibration_monitor_.hold_parameters(*linearisation_, tags.size());
  corner_noise_[camera].fall_quickly(calibration_monitor_.are_confirmed(state_, seen.camera));
  const UpdateReport report =
      corner_update_.apply(state_, seen.camera, model_of(seen.camera), tags,
                           {.gate = gate,
                            .iterations = iterations,
                            .start = linearisation_ ? &*linearisation_ : nullptr,
                            .wants_score = watches},
                           corner_noise_[camera], accepted);
  state_.release_blocks();
  if (linearisation_) linearisation_->release_blocks();
  // Only the second consecutive fit ends a doubt: the first one may remove a tag.
  const bool fits = report.tags_used > 0;
  if (!fits && images_without_fit_ == 0) noise_watch_.begin_doubt();
  if (fits && images_without_fit_ == 0) noise_watch_.end_doubt();
  images_without_fit_ = fits ? 0 : images_without_fit_ + 1;
  const auto& score = corner_update_.shared_score();
  if (learns && score && images_without_fit_ <= kUnfitToLearnFrom) {
    noise_watch_.learn(*score, on_time);
    apply_jitter();
  }
  if (watches && fits && score) noise_watch_.correct(*score, on_time);
  return report;
}

void WorldCoordinates::set_clock(int camera, double shift_s, double sigma_s) {
  noise_watch_.take_back();
  apply_jitter();
  if (!config_.estimate_clocks || !sensors_.imu) return;
  state_.clocks[static_cast<std::size_t>(camera)].shift_s = shift_s;
  open_clock(camera, sigma_s);
}

InitialisationPriors WorldCoordinates::initialisation_priors() const {
  InitialisationPriors out{noise_watch_.learned(), {}, calibration_monitor_.found_wrong(state_)};
  for (const CornerNoise& noise : corner_noise_) out.corners_px.push_back(noise.unexplained_px());
  return out;
}

void WorldCoordinates::begin_with(const InitialisationPriors& priors) {
  noise_watch_.begin_with(priors.sensors);
  calibration_monitor_.open_found(state_, priors.wrong);
  // While a lens is learned its errors appear as corner noise.
  for (std::size_t k = 0; k < priors.corners_px.size(); ++k)
    if (!calibration_monitor_.is_lens_open(state_, static_cast<int>(k)))
      corner_noise_[k].begin_with(priors.corners_px[k]);
}

bool WorldCoordinates::watches_noise() const {
  return is_learning_ && sensors_.imu && config_.doubt_configuration;
}

void WorldCoordinates::doubt(const TagObservations& seen, const UpdateReport& report) {
  if (!state_.has_tested_parameters() || report.nis_dof == 0) return;
  if (holdoff_.active(state_.time)) return calibration_monitor_.reset_tests(state_);
  nis_ += kNisShare * (report.nis / report.nis_dof - nis_);
  if (!calibration_monitor_.update_tests(state_, seen.camera, nis_)) return;
  noise_watch_.unlearn();
  apply_jitter();
}

void WorldCoordinates::correct_by_points(const TagObservations& seen, long image,
                                         UpdateReport& report) {
  if (!window_) return;
  const CameraClock& clock = state_.clocks[static_cast<std::size_t>(seen.camera)];
  // A clone has one exposure time: not for a rolling shutter.
  if (seen.points.size() < kFewestPoints || clock.rows_apart) return;
  CloneWindow::clone(state_, seen.camera, image);
  const CameraModel& lens = lenses_[static_cast<std::size_t>(seen.camera)];
  const LandmarkReport done = window_->correct(state_, memory_, lens, seen.camera);
  report.landmarks_used = done.used;
  report.landmarks_rejected = done.rejected;
  report.landmark_nis = done.nis;
  report.landmark_nis_dof = done.nis_dof;
}

void WorldCoordinates::augment(const TagObservations& seen, const TagObservation& tag,
                               const Pose& X_VT) {
  world::augment(state_, seen.camera, model_of(seen.camera), tag, X_VT, noise(seen.camera));
  calibration_monitor_.watch_print(state_, tag.tag_id);
}

void WorldCoordinates::keep_defined(std::size_t tag, const HeadingRule& rule) {
  const bool level = sensors_.imu.has_value();
  const ReferenceSlack slack = slack_of_reference(state_, tag, rule, level);
  if (slack.moved > kSlipped || slack.sigma > kUnsure)
    anchor_to_reference(state_, tag, rule, level);
}

}  // namespace fiducap::world
