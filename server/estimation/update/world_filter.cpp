#include "estimation/update/world_filter.hpp"

#include <algorithm>

#include "estimation/start/time_offset.hpp"

namespace fiducap::world {

WorldFilter::WorldFilter(BodySensors sensors, WorkspaceGauge gauge, EstimatorConfig config)
    : sensors_(std::move(sensors)),
      gauge_(gauge),
      config_(config),
      search_(
          clock_prior(), are_clocks_vague(),
          [this](const ClockHypothesis& clocks) { return make(clocks); },
          [this](const StartLog& log) { return clocks_by_rotations(log); }),
      present_(make(configured_clocks())),
      generation_(present_->generation()) {
  if (!search_.is_open()) present_->end_start();
}

HypothesisPlan::Prior WorldFilter::clock_prior() const {
  HypothesisPlan::Prior prior;
  for (std::size_t k = 0; k < sensors_.cameras.size(); ++k) {
    prior.shifts_s.push_back(k < sensors_.start_shifts_s.size() ? sensors_.start_shifts_s[k] : 0.0);
    prior.sigmas_s.push_back(sensors_.cameras[k].time_shift_sigma_s);
  }
  return prior;
}

bool WorldFilter::are_clocks_vague() const {
  return sensors_.imu && config_.estimate_clocks &&
         std::ranges::any_of(sensors_.cameras,
                             [](const CameraMount& mount) { return mount.time_shift_sigma_s > 0; });
}

/// Of a camera that does not rotate: as configured.
std::vector<double> WorldFilter::clocks_by_rotations(const StartLog& log) const {
  constexpr std::size_t kAllTurns = 150;  // ten a second, of a whole log
  std::vector<TimeOffset> offsets;
  for (const CameraMount& camera : sensors_.cameras)
    offsets.emplace_back(camera.model, camera.X_BV.q, config_.corner_noise_px, kAllTurns);
  GyroIntegral gyro(sensors_.imu->gyro_range_rad_s);
  auto imu = log.imu().begin();
  for (const StartLog::Image& image : log.images()) {
    for (; imu != log.imu().end() && imu->sampled_at < image.seen.exposed_at; ++imu) gyro.add(*imu);
    offsets[static_cast<std::size_t>(image.seen.camera)].add(image.seen, gyro);
  }
  auto [shifts_s, sigmas_s] = clock_prior();
  for (std::size_t k = 0; k < offsets.size(); ++k) {
    if (!(sigmas_s[k] > 0)) continue;  // known exactly
    const OffsetFit fit = offsets[k].fit(Axes::kConfigured, {shifts_s[k], sigmas_s[k]}, kAllTurns);
    if (fit.explains()) shifts_s[k] = fit.shift_s;
  }
  return shifts_s;
}

std::unique_ptr<StartingFilter> WorldFilter::make(const ClockHypothesis& clocks) const {
  auto filter = std::make_unique<TagFilter>(sensors_, gauge_, config_, clocks);
  filter->set_tag_priors(priors_);
  return filter;
}

void WorldFilter::set_tag_priors(std::vector<KnownTag> priors) {
  priors_ = std::move(priors);
  present_->set_tag_priors(priors_);
}

void WorldFilter::propagate(const ImuSample& imu) {
  search_.add(imu);
  present_->propagate(imu);
}

void WorldFilter::lose_motion() {
  present_->lose_motion();
  if (present_->generation() != generation_) follow_restart();
}

UpdateReport WorldFilter::update(const TagObservations& seen, const MapKnowledge& map) {
  const StartingFilter::Axes before = present_->axes();
  UpdateReport report = present_->update(seen, map);
  if (present_->generation() != generation_) {
    follow_restart();
  } else if (auto better = search_.add(seen, map, *present_)) {
    take_over(std::move(*better), before, report);
  }
  report.start_is_open = search_.is_open();
  return report;
}

void WorldFilter::follow_restart() {
  generation_ = present_->generation();
  search_.begin();
  if (!search_.is_open()) present_->end_start();
}

void WorldFilter::take_over(StartSearch::Start start, const StartingFilter::Axes& before,
                            UpdateReport& report) {
  std::unique_ptr<StartingFilter>& better = start.filter;
  if (!better->running() || !present_->running()) return;
  // Earlier poses are in the previous axes: the same when defined by the same tag or the map.
  if (before.are_anchored && before == better->axes()) {
    report.gauge_shift.reset();
  } else {
    const Pose moved = better->estimate().X_WB * present_->estimate().X_WB.inverse();
    report.gauge_shift = moved * report.gauge_shift.value_or(Pose{});
  }
  report.start_changed = true;
  better->set_generation(generation_);
  better->set_restart_clocks(configured_clocks());
  present_ = std::move(better);
  start_ = std::move(start.observer);
}

}  // namespace fiducap::world
