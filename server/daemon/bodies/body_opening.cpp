#include "daemon/bodies/body_opening.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "capture/camera_device.hpp"
#include "daemon/bodies/reopening_source.hpp"

namespace fiducap {

namespace {

/// Without them there is no filter, so no body either.
bool knows_lenses(const BodySetup& setup) {
  const auto& cameras = setup.sensors.cameras;
  return std::all_of(cameras.begin(), cameras.end(),
                     [](const CameraMount& camera) { return camera.model.width > 0; });
}

Error about(const BodyConfig& config, const Error& error) {
  return {error.code, config.name + ": " + error.text(), {}};
}

/// What images are held against: the calibrated size, and the rate that was asked of a device.
std::vector<ImageWatch::Promise> promises_of(const BodyConfig& config, const BodySetup& setup) {
  std::vector<ImageWatch::Promise> all;
  // Without noise every image of a robot at rest is the one before.
  const bool has_noise = config.source.simulator.camera.pixel_noise > 0;
  if (config.source.type == SourceType::kSimulator && !has_noise) return all;
  const auto& cameras = setup.sensors.cameras;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    ImageWatch::Promise promise{{cameras[k].model.width, cameras[k].model.height}, 0};
    if (config.source.type == SourceType::kCamera && !is_file(config.source.camera))
      promise.rate_hz = config.source.camera.rate_hz;
    const auto own = k < config.cameras.size() ? config.cameras[k].source : std::nullopt;
    if (own && own->type == CameraSourceType::kCamera && !is_file(own->camera))
      promise.rate_hz = own->camera.rate_hz;
    all.push_back(promise);
  }
  return all;
}

/// The others of its body go on without it.
bool has_others(const BodyConfig& config, const SensorPart& part) {
  const auto parts = parts_of(config);
  return std::count_if(parts.begin(), parts.end(), gives_images) > (gives_images(part) ? 1 : 0);
}

}  // namespace

BodyOpening::BodyOpening(const ServerConfig& config, const ServerOptions& options,
                         const Clock& clock, EventBoard& events, dds::Membership& membership,
                         std::function<void(std::size_t)> lost)
    : config_(config),
      options_(options),
      clock_(clock),
      events_(events),
      membership_(membership),
      lost_(std::move(lost)) {}

Expected<std::vector<BodyOpening::Body>> BodyOpening::open_all(const StartMap& start) {
  std::vector<Body> bodies;
  simulation_start_ = clock_.now();
  for (const auto& config : config_.bodies) {
    auto body = open_body(config, start);
    if (!body) return tl::unexpected(body.error());
    bodies.push_back(std::move(*body));
  }
  if (opened_ == 0 && first_failure_) return tl::unexpected(*first_failure_);
  return bodies;
}

Expected<BodyOpening::Body> BodyOpening::open_body(const BodyConfig& config,
                                                   const StartMap& start) {
  auto setup = read_body_setup(config, config_.simulation, config_.site);
  if (!setup) return tl::unexpected(about(config, setup.error()));
  if (setup->recording) warn_about_tags(config.name, *setup->recording, config_.tags);
  if (config_.map.use_learned_extrinsics) use_learned(start.learned, config.name, setup->sensors);
  Body body{std::move(*setup), {}, {}};
  for (const SensorPart& part : parts_of(config)) {
    auto source = open(config, part, body.setup);
    if (!source) {
      Error why = about(config, source.error());
      if (!part.is_imu && !knows_lenses(body.setup)) return tl::unexpected(std::move(why));
      if (!first_failure_) first_failure_ = std::move(why);
    }
    const bool again = comes_back(config, part);
    if (source || again) ++opened_;
    if (source && !again) body.truth = truth_of(**source, config_);
    body.sources.push_back({keep_open(config, part, body.setup, std::move(source)), name_of(part),
                            gives_images(part), promises_of(config, body.setup)});
  }
  return body;
}

BodyOpening::Opened BodyOpening::open(const BodyConfig& config, const SensorPart& part,
                                      BodySetup& setup) {
  auto source = open_source(config, part, setup,
                            {.room = config_.simulation,
                             .clock = clock_,
                             .simulation_start = simulation_start_,
                             .motion = options_.motion ? options_.motion(config.name) : nullptr,
                             .join_dds = [this] { return membership_.join(); }});
  if (source && options_.source) *source = options_.source(config.name, std::move(*source));
  return source;
}

bool BodyOpening::comes_back(const BodyConfig& config, const SensorPart& part) const {
  return may_come_back(config, part) || options_.source;
}

/// A device that is lost, or not there yet, is opened again; any other source fails for good.
/// @param config  outlives the source
std::unique_ptr<SensorSource> BodyOpening::keep_open(const BodyConfig& config,
                                                     const SensorPart& part, const BodySetup& setup,
                                                     Opened source) {
  if (!comes_back(config, part)) return source ? std::move(*source) : failed_source(source.error());
  const std::string what = name_of(part);
  std::string kind = what;  // `camera 1` → `camera_1`
  std::replace(kind.begin(), kind.end(), ' ', '_');
  ReopeningSource::Listener listener{
      [this, what, kind, &config, alone = !has_others(config, part)](const Error& why) {
        if (alone) lost_(static_cast<std::size_t>(&config - config_.bodies.data()));
        events_.begin({.severity = Severity::kError,
                       .subject = config.name,
                       .kind = kind,
                       .text = "its " + what + " is lost: " + why.text(),
                       .remedy = "It is opened again until it comes back"});
      },
      [this, what, kind, &config] { events_.end(config.name, kind, "its " + what + " is back"); }};
  return std::make_unique<ReopeningSource>(
      std::move(source),
      [this, &config, part, own = BodySetup(setup)]() mutable { return open(config, part, own); },
      std::move(listener), clock_);
}

}  // namespace fiducap
