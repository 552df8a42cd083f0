#include "daemon/bodies/body_worker.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "base/log.hpp"
#include "daemon/system.hpp"

namespace fiducap {
namespace {

constexpr Duration kRememberPeriod = std::chrono::seconds(2);
// A clock offset is reported once, when its sigma is below the first and it exceeds the second.
constexpr double kKnownShift_s = 1e-3;
constexpr double kReportedShift_s = 5e-3;

// An image that waited for longer is skipped when there is a newer one.
constexpr Duration kStale = std::chrono::milliseconds(200);

/// Conditions of a body that its pipeline judges.
struct Condition {
  BodyEvent::Kind event;
  std::string_view kind;  ///< On the event board.
  bool holds;
  Severity severity{Severity::kInfo};
};
constexpr std::array kConditions{
    Condition{BodyEvent::Kind::kImuSilent, "imu_silent", true, Severity::kWarning},
    Condition{BodyEvent::Kind::kImuBack, "imu_silent", false},
    Condition{BodyEvent::Kind::kImuUnusable, "imu_readings", true, Severity::kError},
    Condition{BodyEvent::Kind::kImuDoubtful, "imu_readings", true, Severity::kWarning},
    Condition{BodyEvent::Kind::kImuPlausible, "imu_readings", false},
    Condition{BodyEvent::Kind::kTurnsDisagree, "turns_disagree", true, Severity::kError},
    Condition{BodyEvent::Kind::kTurnsAgree, "turns_disagree", false}};

// Of each camera; more waiting images would only make the newest late.
constexpr std::size_t kWaitingImages = 4;

}  // namespace

BodyWorker::BodyWorker(BodyParts parts, const SharedParts& shared)
    : index_(parts.index),
      id_(parts.id),
      name_(std::move(parts.name)),
      shared_(shared),
      setup_(std::move(parts.setup)),
      make_filter_(std::move(parts.make_filter)),
      views_(std::move(parts.views)),
      pipeline_(make_pipeline()),
      inbox_(kWaitingImages * std::max<std::size_t>(1, setup_.sensors.cameras.size())),
      began_at_(shared.clock.now()) {
  for (BodySource& source : parts.sources) {
    if (source.gives_images) ++image_readers_;
    readers_.push_back(std::make_unique<BodyReader>(
        std::move(source), name_,
        [this](SensorSample sample) { return pass_on(std::move(sample)); }, shared.events,
        shared.clock));
  }
}

void BodyWorker::read(std::size_t source, std::stop_token stop) {
  BodyReader& reader = *readers_[source];
  reader.read(std::move(stop));
  if (reader.gives_images() && --image_readers_ == 0) inbox_.finish();
}

/// @return false: no more samples are taken
bool BodyWorker::pass_on(SensorSample sample) {
  const Instant now = shared_.clock.now();
  const auto* imu = std::get_if<ImuSample>(&sample);
  if (imu != nullptr && !setup_.sensors.imu) return true;
  if (imu != nullptr) {
    if (imu->w_WB_B.allFinite() && imu->f_B.allFinite()) shared_.scene.add_imu(index_, *imu);
  } else {
    pulse_.image_came_ns = to_ns(now);
    if (const int k = camera_of(sample); k >= 0 && k < kMostCameras)
      pulse_.camera_came_ns[static_cast<std::size_t>(k)] = to_ns(now);
    ++pulse_.images;
  }
  return inbox_.push(std::move(sample), now);
}

void BodyWorker::work(std::stop_token stop) {
  while (const auto why = work_until_failure(stop)) restart(*why, stop);
  inbox_.close();
  shared_.map.release(id_);
  pulse_.ended = true;
  if (stop.stop_requested()) return;
  end_conditions({"source_failed", "failed", "imu_silent", "imu_readings", "turns_disagree"},
                 "its source has ended");
  shared_.scene.source_lost(index_);
  log::warning("pipeline", name_ + " is lost; the server continues");
}

std::unique_ptr<BodyPipeline> BodyWorker::make_pipeline() const {
  return std::make_unique<BodyPipeline>(setup_, make_filter_ ? make_filter_() : nullptr);
}

/// @return why the pipeline has to be restarted; nullopt: the samples have ended
std::optional<std::string> BodyWorker::work_until_failure(std::stop_token stop) {
  try {
    if (!pipeline_) {
      auto fresh = make_pipeline();
      const std::lock_guard lock(pipeline_mutex_);
      pipeline_ = std::move(fresh);
    }
    if (work_samples(stop)) return std::nullopt;
    return "too many IMU readings wait for an image";
  } catch (const std::exception& failure) {
    return failure.what();
  }
}

void BodyWorker::end_conditions(std::initializer_list<std::string_view> kinds,
                                std::string_view why) {
  const auto whose = [this] { return name_; };
  for (const std::string_view kind : kinds)
    log::guarded("pipeline", whose, [&] { shared_.events.end(name_, kind, why); });
}

/// Restarts the pipeline, which loses its estimates; the map keeps its tags.
void BodyWorker::restart(const std::string& why, std::stop_token stop) {
  const Instant now = shared_.clock.now();
  const auto whose = [this] { return name_; };
  log::guarded("pipeline", whose, [&] {
    shared_.events.begin({.severity = Severity::kError,
                          .subject = name_,
                          .kind = "failed",
                          .text = "estimator failed (" + why + "); restarting",
                          .remedy = "This is a defect of the server: please report it"});
    ++statistics_.restarts;
    shared_.scene.source_lost(index_);
    shared_.map.release(id_);
  });
  end_conditions({"imu_silent", "imu_readings", "turns_disagree"},
                 "the estimator restarts and checks the IMU again");
  if (!shared_.clock.wait_until(now + backoff_.pause_after(now - began_at_), stop)) return;
  inbox_.clear();
  began_at_ = shared_.clock.now();
  if (!pipeline_) return;
  // Counters never decrease.
  statistics_.pipeline += pipeline_->statistics();
  const std::lock_guard lock(pipeline_mutex_);
  pipeline_ = nullptr;
}

/// @return false: IMU readings pile up
bool BodyWorker::work_samples(std::stop_token stop) {
  while (inbox_.take(taken_, stop)) {
    for (Delivery& delivery : taken_) {
      if (!std::holds_alternative<ImuSample>(delivery.sample))
        arrivals_[next_arrival_++ % arrivals_.size()] = {time_of(delivery.sample),
                                                         delivery.arrived};
      if (!pipeline_->push(std::move(delivery.sample))) return false;
      process_ready_samples();
    }
  }
  if (stop.stop_requested()) return true;
  pipeline_->finish();
  process_ready_samples();
  return true;
}

void BodyWorker::process_ready_samples() {
  while (const SensorSample* sample = pipeline_->next()) {
    if (is_stale(*sample)) {
      pipeline_->skip();
      continue;
    }
    shared_.recorder.take(index_, *sample);
    const MapView view = pipeline_->next_is_image() ? shared_.map.view(id_) : MapView{};
    if (views_) views_->note(*sample);
    const auto* frame = std::get_if<CameraFrame>(&*sample);
    const SharedImage image = frame != nullptr ? frame->image : nullptr;
    const BodyUpdate* update = pipeline_->take(view);
    if (update == nullptr) continue;
    pulse_.unseen.note(image, update->seen.exposed_at, !update->seen.tags.empty());
    if (!pipeline_->source_gives_corners()) shared_.recorder.take_found(index_, update->corners);
    const std::uint64_t turn = shared_.map.absorb(contribution_of(view, *update), utc_now_ns());
    shared_.recorder.take_turn(index_, *update, view, turn);
    count(*update);
    report_events(*update);
    remember_cameras(*update);
    if (views_) views_->show(*pipeline_, *update, *view.map);
  }
}

/// It would only delay a newer image.
bool BodyWorker::is_stale(const SensorSample& sample) const {
  if (std::holds_alternative<ImuSample>(sample)) return false;
  const Instant arrived = arrival_of(time_of(sample) - clock_shift_of(sample));
  return to_ns(arrived) < pulse_.image_came_ns && shared_.clock.now() - arrived > kStale;
}

void BodyWorker::count(const BodyUpdate& update) {
  const std::uint64_t dropped = images_left_out();
  const Instant now = shared_.clock.now();
  const Instant stamp = update.corners.exposed_at - update.corners.clock_shift;
  shared_.scene.ingest(index_, update.shown(), update.report, now - arrival_of(stamp), dropped);
  const Duration lateness = now - update.seen.exposed_at;
  statistics_.lateness.add(lateness);
  pulse_.lateness_ns = lateness.count();
  pulse_.on_the_way_ns = (arrival_of(stamp) - update.seen.exposed_at).count();
  pulse_.skipped = dropped;
}

void BodyWorker::report_events(const BodyUpdate& update) {
  for (const auto& event : shared_.map.take_events()) {
    // The map keeper reports versions.
    const bool is_frequent = event.kind == MapEvent::Kind::kPublished;
    const bool is_bad =
        event.kind == MapEvent::Kind::kTagQuarantined || event.kind == MapEvent::Kind::kTagDisputed;
    log::write(is_bad        ? log::Level::kWarning
               : is_frequent ? log::Level::kDebug
                             : log::Level::kInfo,
               "mapping", event.text);
  }
  if (update.is_placed()) shared_.events.end(name_, "failed", "is tracked again");
  for (const BodyEvent& event : update.events)
    if (!event.text.empty()) report(event);
}

/// Begins or ends a condition, or reports a single event.
void BodyWorker::report(const BodyEvent& event) {
  const auto condition = std::ranges::find(kConditions, event.kind, &Condition::event);
  if (condition != kConditions.end())
    return shared_.events.set(condition->holds,
                              {.severity = condition->severity,
                               .subject = name_,
                               .kind = std::string(condition->kind),
                               .text = event.text},
                              event.text);
  const bool is_info = event.kind == BodyEvent::Kind::kMapCorrection;
  shared_.events.report({.severity = is_info ? Severity::kInfo : Severity::kWarning,
                         .subject = name_,
                         .kind = std::string(name_of(event.kind)),
                         .text = event.text});
}

std::uint64_t BodyWorker::images_left_out() const {
  PipelineStatistics done = statistics_.pipeline;
  if (pipeline_) done += pipeline_->statistics();
  return inbox_.images_dropped() + done.merger.images_dropped + done.skipped;
}

/// @param stamp  of an image, as the device gave it
Instant BodyWorker::arrival_of(Instant stamp) const {
  const auto found = std::ranges::find(arrivals_, stamp, &Arrival::stamp);
  return found == arrivals_.end() ? stamp : found->arrived;
}

void BodyWorker::remember_cameras(const BodyUpdate& update) {
  const Instant now = update.seen.exposed_at;
  if (!update.estimate || (learned_at_ && now - *learned_at_ < kRememberPeriod)) return;
  learned_at_ = now;
  if (!clocks_announced_) announce_clocks(update.cameras);
  const std::lock_guard lock(learned_mutex_);
  learned_ = update.cameras;
}

void BodyWorker::announce_clocks(const std::vector<ExtrinsicsEstimate>& cameras) {
  const auto is_known = [](const ExtrinsicsEstimate& camera) {
    return camera.clock.shift_sigma_s < kKnownShift_s;
  };
  clocks_announced_ = std::ranges::all_of(cameras, is_known);
  if (!clocks_announced_) return;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    if (std::abs(cameras[k].clock.shift_s) < kReportedShift_s) continue;
    log::info("estimation", name_ + ": " +
                                calibration_text(k, cameras[k], setup_.sensors.cameras[k]) +
                                "; its stamps are corrected by that");
  }
}

std::vector<std::string> BodyWorker::learned_text() const {
  std::vector<std::string> lines;
  const auto cameras = learned();
  const auto& configured = setup_.sensors.cameras;
  for (std::size_t k = 0; k < cameras.size() && k < configured.size(); ++k)
    lines.push_back(calibration_text(k, cameras[k], configured[k]));
  return lines;
}

std::vector<std::string> BodyWorker::doubts() const {
  const std::lock_guard lock(pipeline_mutex_);
  return pipeline_ ? pipeline_->doubts() : std::vector<std::string>{};
}

BodyStatistics BodyWorker::statistics() const {
  BodyStatistics all = statistics_;
  if (pipeline_) all.pipeline += pipeline_->statistics();
  all.images_dropped = images_left_out();
  return all;
}

std::vector<ExtrinsicsEstimate> BodyWorker::learned() const {
  const std::lock_guard lock(learned_mutex_);
  return learned_;
}

}  // namespace fiducap
