#include "daemon/bodies/body_setup.hpp"

#include <algorithm>
#include <exception>
#include <utility>

#include "capture/camera_device.hpp"

namespace fiducap {

ReopeningSource::ReopeningSource(OpenedSource first, Open open, Listener listener,
                                 const Clock& clock)
    : open_(std::move(open)), listener_(std::move(listener)), clock_(clock) {
  if (first) {
    source_ = std::move(*first);
  } else {
    at_start_ = std::move(first.error());
  }
}

Expected<std::optional<SensorSample>> ReopeningSource::next(std::stop_token stop) {
  if (at_start_) lose(*std::exchange(at_start_, std::nullopt));
  while (!stop.stop_requested()) {
    if (!source_ && !wait_and_reopen(stop)) continue;
    auto sample = ask(stop);
    if (!sample) {
      lose(sample.error());
      continue;
    }
    if (sample->has_value()) note_sample();
    return sample;
  }
  return std::nullopt;
}

Expected<std::optional<SensorSample>> ReopeningSource::ask(std::stop_token stop) {
  try {
    return source_->next(std::move(stop));
  } catch (const std::exception& failure) {
    return fail(ErrorCode::kUnavailable, failure.what());
  }
}

/// A single sample does not prove that the device works.
void ReopeningSource::note_sample() {
  gave_at_ = clock_.now();
  if (!gives_since_) gives_since_ = gave_at_;
  if (reported_.empty() || gave_at_ - *gives_since_ < kBackAfter) return;
  reported_.clear();
  listener_.back();
}

void ReopeningSource::lose(const Error& why) {
  source_.reset();  // releases the device, which could not be opened otherwise
  const auto gave_since = std::exchange(gives_since_, std::nullopt);
  if (gave_since) backoff_.lasted(gave_at_ - *gave_since);
  std::string text = why.text();
  if (text == reported_ && !gave_since) return;
  reported_ = std::move(text);
  listener_.lost(why);
}

bool ReopeningSource::wait_and_reopen(std::stop_token stop) {
  if (!clock_.wait_until(clock_.now() + backoff_.pause(), stop)) return false;
  try {
    auto opened = open_();
    if (opened) {
      source_ = std::move(*opened);
    } else {
      lose(opened.error());
    }
  } catch (const std::exception& failure) {
    lose(Error{ErrorCode::kUnavailable, failure.what(), {}});
  }
  return source_ != nullptr;
}

namespace {

/// Without lenses there is no filter.
bool knows_lenses(const BodySetup& setup) {
  const auto& cameras = setup.sensors.cameras;
  return std::ranges::all_of(cameras,
                             [](const CameraMount& camera) { return camera.model.width > 0; });
}

Error about(const BodyConfig& config, const Error& error) {
  return {error.code, config.name + ": " + error.text(), {}};
}

/// Expectations for the images: the calibrated size, and the requested rate of a device.
std::vector<ImageWatch::Nominal> nominal_images(const BodyConfig& config, const BodySetup& setup) {
  std::vector<ImageWatch::Nominal> all;
  // Without noise all images of a robot at rest are equal.
  const bool has_noise = config.source.simulator.camera.pixel_noise > 0;
  if (config.source.type == SourceType::kSimulator && !has_noise) return all;
  const auto& cameras = setup.sensors.cameras;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    ImageWatch::Nominal nominal{{cameras[k].model.width, cameras[k].model.height}, 0};
    if (config.source.type == SourceType::kCamera && !is_file(config.source.camera))
      nominal.rate_hz = config.source.camera.rate_hz;
    const auto own = k < config.cameras.size() ? config.cameras[k].source : std::nullopt;
    if (own && own->type == CameraSourceType::kCamera && !is_file(own->camera))
      nominal.rate_hz = own->camera.rate_hz;
    all.push_back(nominal);
  }
  return all;
}

}  // namespace

BodyOpening::BodyOpening(const ServerConfig& config, SourceHooks hooks, const Clock& clock,
                         EventBoard& events, dds::Membership& membership,
                         std::function<void(std::size_t)> lost)
    : config_(config),
      hooks_(std::move(hooks)),
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
                            gives_images(part), nominal_images(config, body.setup)});
  }
  return body;
}

OpenedSource BodyOpening::open(const BodyConfig& config, const SensorPart& part, BodySetup& setup) {
  auto source = open_source(config, part, setup,
                            {.room = config_.simulation,
                             .clock = clock_,
                             .simulation_start = simulation_start_,
                             .motion = hooks_.motion ? hooks_.motion(config.name) : nullptr,
                             .join_dds = [this] { return membership_.join(); }});
  if (source && hooks_.source) *source = hooks_.source(config.name, std::move(*source));
  return source;
}

bool BodyOpening::comes_back(const BodyConfig& config, const SensorPart& part) const {
  return may_come_back(config, part) || hooks_.source;
}

/// Reopens a device that is lost or missing; any other source fails for good.
/// @param config  outlives the source
std::unique_ptr<SensorSource> BodyOpening::keep_open(const BodyConfig& config,
                                                     const SensorPart& part, const BodySetup& setup,
                                                     OpenedSource source) {
  if (!comes_back(config, part)) return source ? std::move(*source) : failed_source(source.error());
  const std::string what = name_of(part);
  std::string kind = what;  // `camera 1` → `camera_1`
  std::replace(kind.begin(), kind.end(), ' ', '_');
  const auto parts = parts_of(config);
  const bool alone = std::ranges::count_if(parts, gives_images) <= (gives_images(part) ? 1 : 0);
  ReopeningSource::Listener listener{
      [this, what, kind, &config, alone](const Error& why) {
        if (alone) lost_(static_cast<std::size_t>(&config - config_.bodies.data()));
        events_.begin({.severity = Severity::kError,
                       .subject = config.name,
                       .kind = kind,
                       .text = "its " + what + " is lost: " + why.text(),
                       .remedy = "It is reopened until it comes back"});
      },
      [this, what, kind, &config] { events_.end(config.name, kind, "its " + what + " is back"); }};
  return std::make_unique<ReopeningSource>(
      std::move(source),
      [this, &config, part, own = BodySetup(setup)]() mutable { return open(config, part, own); },
      std::move(listener), clock_);
}

}  // namespace fiducap
