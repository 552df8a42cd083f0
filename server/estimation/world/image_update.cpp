#include "estimation/world/image_update.hpp"

#include "estimation/world/corner_measurement.hpp"

namespace fiducap::world {

namespace {
constexpr double kNisShare = 0.02;
}  // namespace

ImageUpdate::ImageUpdate(const BodySensors& sensors, const EstimatorConfig& config)
    : sensors_(sensors),
      config_(config),
      // Without an IMU the parameters cannot be distinguished.
      calibration_monitor_(sensors,
                           {.doubts = config.doubt_configuration && sensors.imu.has_value(),
                            .refines = config.refine_intrinsics,
                            .assumes = config.doubt_configuration && !sensors.imu}) {
  for (const CameraMount& mount : sensors.cameras) {
    lenses_.push_back(mount.model);
    corner_noise_.emplace_back(config, config.learn_corner_noise, &mount);
  }
}

void ImageUpdate::restart(FilterState& state) {
  calibration_monitor_.begin(state);
  noise_watch_.restart();
  nis_ = 1;
}

void ImageUpdate::look_at(FilterState& state, const TagObservations& seen) {
  const auto camera = static_cast<std::size_t>(seen.camera);
  state.clocks[camera].applied_s = to_seconds(seen.clock_shift);
  lenses_[camera] = state.lenses[camera].applied_to(sensors_.cameras[camera].model);
}

UpdateReport ImageUpdate::correct(FilterState& state, FilterState* linearisation,
                                  const TagObservations& seen, std::span<const TagToUse> tags,
                                  const GateLimits& gate, int iterations,
                                  std::vector<bool>& accepted) {
  const auto camera = static_cast<std::size_t>(seen.camera);
  const bool watches = watches_noise();
  const bool teaches =
      watches && !holdoff_.active(state.time) && teaches_of_noise(state, seen.camera, tags);
  const Vector6d on_time =
      camera_at(state, seen.camera, state.clocks[camera].seconds_to(0)).on_time;
  for (FilterState* held : {&state, linearisation})
    if (!sensors_.imu && held != nullptr) calibration_monitor_.hold_parameters(*held, tags.size());
  corner_noise_[camera].fall_quickly(calibration_monitor_.are_confirmed(state, seen.camera));
  const UpdateReport report = corner_update_.apply(
      state, seen.camera, sensors_.cameras[camera].model, tags,
      {.gate = gate, .iterations = iterations, .start = linearisation, .wants_score = watches},
      corner_noise_[camera], accepted);
  state.release_blocks();
  if (linearisation != nullptr) linearisation->release_blocks();
  learn_noise(state, report, on_time, teaches);
  return report;
}

void ImageUpdate::learn_noise(FilterState& state, const UpdateReport& report,
                              const Vector6d& on_time, bool teaches) {
  // Noise of IMU and stamps is common to all tags of an image. Where one is rejected, it is the tag
  // or the place of the body that is wrong.
  const bool fits = report.tags_used > 0;
  const auto& score = corner_update_.shared_score();
  if (teaches && fits && report.tags_rejected == 0 && score) {
    noise_watch_.learn(*score, on_time);
    apply_jitter(state);
  }
  if (watches_noise() && fits && score) noise_watch_.correct(*score, on_time);
}

bool ImageUpdate::watches_noise() const {
  return is_learning_ && sensors_.imu && config_.doubt_configuration;
}

void ImageUpdate::test(FilterState& state, const TagObservations& seen,
                       const UpdateReport& report) {
  if (!state.has_tested_parameters() || report.nis_dof == 0) return;
  if (holdoff_.active(state.time)) return calibration_monitor_.reset_tests(state);
  nis_ += kNisShare * (report.nis / report.nis_dof - nis_);
  if (!calibration_monitor_.update_tests(state, seen.camera, nis_)) return;
  noise_watch_.unlearn();
  apply_jitter(state);
}

void ImageUpdate::follow_map(FilterState& state, const KnownMap& map, int body_id,
                             const Pose& moved,
                             std::span<const CalibrationMonitor::TestStatistics> before) {
  calibration_monitor_.restore_test_statistics(state, before);
  if (calibration_monitor_.follow_map(state, map, body_id)) noise_watch_.unlearn();
  apply_jitter(state);
  holdoff_.note(moved, state.X_WB, state.time);
  noise_watch_.lose_motion();  // covariance in the old axes
}

InitialisationPriors ImageUpdate::initialisation_priors(const FilterState& state) const {
  InitialisationPriors out{noise_watch_.learned(), {}, calibration_monitor_.found_wrong(state)};
  for (const CornerNoise& noise : corner_noise_) out.corners_px.push_back(noise.unexplained_px());
  return out;
}

void ImageUpdate::begin_with(FilterState& state, const InitialisationPriors& priors) {
  noise_watch_.begin_with(priors.sensors);
  calibration_monitor_.open_found(state, priors.wrong);
  // While a lens is learned its errors appear as corner noise.
  for (std::size_t k = 0; k < priors.corners_px.size(); ++k)
    if (!calibration_monitor_.is_lens_open(state, static_cast<int>(k)))
      corner_noise_[k].begin_with(priors.corners_px[k]);
}

BodyEstimate ImageUpdate::body(const FilterState& state) const {
  BodyEstimate out = body_in_workspace(state);
  const Matrix6d J = plain_from_world_error(out.X_WB.p);
  out.covariance.topLeftCorner<6, 6>() +=
      J * calibration_monitor_.unmodelled_covariance(state) * J.transpose();
  out.covariance *= noise_watch_.variance_inflation();
  return out;
}

BodyPlace ImageUpdate::place(const FilterState& state) const {
  const auto J = plain_from_world_error(state.X_WB.p).topRows<3>().eval();
  const Matrix6d own =
      state.P().topLeftCorner<6, 6>() + calibration_monitor_.unmodelled_covariance(state);
  return {state.X_WB.p, J * own * J.transpose()};
}

std::vector<SightedTag> ImageUpdate::sighted(const FilterState& state, int camera,
                                             std::span<const TagToUse> tags) const {
  const auto k = static_cast<std::size_t>(camera);
  std::vector<SightedTag> out;
  for (const TagToUse& tag : tags)
    out.push_back({tag.seen, &lenses_[k], state.X_BV[k], place_of(state, tag), state.lenses[k].k1});
  return out;
}

}  // namespace fiducap::world
