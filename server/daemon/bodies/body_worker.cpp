#include "daemon/bodies/body_worker.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <sstream>
#include <utility>

#include "base/cpu_time.hpp"
#include "base/log.hpp"
#include "daemon/bodies/calibration_report.hpp"
#include "daemon/system_clock.hpp"
#include "detection/observe.hpp"

namespace fiducap {

namespace {

constexpr Duration kRememberPeriod = std::chrono::seconds(2);
// A clock known this well is said once, when it is off by so much that somebody should look.
constexpr double kKnownShift_s = 1e-3;
constexpr double kWorthSaying_s = 5e-3;
// A tag unseen for so long has left the view.
constexpr Duration kOutOfView = std::chrono::seconds(2);

MergerConfig merger_config(const BodySensors& sensors) {
  MergerConfig config;
  config.has_imu = sensors.imu.has_value();
  config.max_images = 4 * sensors.cameras.size();  // older ones would only make the newest late
  return config;
}

/// Adds the CPU time between its birth and its death.
class CpuMeter final {
 public:
  explicit CpuMeter(Duration& sum) : sum_(sum), begin_(thread_cpu_time()) {}
  ~CpuMeter() { sum_ += thread_cpu_time() - begin_; }
  CpuMeter(const CpuMeter&) = delete;
  CpuMeter& operator=(const CpuMeter&) = delete;

 private:
  Duration& sum_;
  Duration begin_;
};

}  // namespace

BodyWorker::BodyWorker(BodyParts parts, const SharedParts& shared)
    : parts_(std::move(parts)),
      shared_(shared),
      inbox_(merger_config(parts_.sensors)),
      doubts_(parts_.sensors, shared.estimator) {
  for (int camera = 0; camera < static_cast<int>(parts_.sensors.cameras.size()); ++camera)
    inbox_.set_clock_shift(camera, shift_to_apply(parts_.filter->clock(camera), Duration{0}));
}

void BodyWorker::read(std::stop_token stop) {
  try {
    read_samples(stop);
  } catch (const std::exception& failure) {
    log::error("capture", parts_.name + ": " + failure.what());
  }
  inbox_.finish();
  reading_ = false;
}

void BodyWorker::read_samples(std::stop_token stop) {
  while (!stop.stop_requested()) {
    auto sample = parts_.source->next(stop);
    if (!sample)
      return log::error("capture", parts_.name + ": source lost: " + sample.error().text());
    if (!sample->has_value()) {
      if (!stop.stop_requested()) log::info("capture", parts_.name + ": source has ended");
      return;
    }
    const auto* imu = std::get_if<ImuSample>(&**sample);
    if (imu != nullptr && !parts_.sensors.imu) continue;
    if (imu != nullptr && imu->w_WB_B.allFinite() && imu->f_B.allFinite())
      shared_.scene.add_imu(parts_.index, *imu);
    if (!inbox_.push(std::move(**sample), shared_.clock.now())) {
      return log::error(
          "capture", parts_.name + ": the worker does not keep up with the IMU; the body is lost");
    }
  }
}

void BodyWorker::work(std::stop_token stop) {
  try {
    work_samples(stop);
  } catch (const std::exception& failure) {
    log::error("app", parts_.name + ": " + failure.what());
  }
  inbox_.close();
  statistics_.merger = inbox_.statistics();
  ended_ = true;
  if (stop.stop_requested()) return;
  shared_.scene.source_lost(parts_.index);
  log::warning("app", parts_.name + " is lost; the server goes on");
}

void BodyWorker::work_samples(std::stop_token stop) {
  while (const auto delivery = inbox_.pop(stop)) {
    if (const auto* imu = std::get_if<ImuSample>(&delivery->sample)) {
      const CpuMeter meter(statistics_.propagate_cpu);
      parts_.filter->propagate(*imu);
      if (search_) search_->add_imu(*imu);
      doubts_.add(*imu);
      shared_.recorder.take(parts_.index, delivery->sample);
      ++statistics_.imu_samples;
      continue;
    }
    take_frame(*delivery);
  }
}

void BodyWorker::take_frame(const Delivery& delivery) {
  const CornerFrame& corners = corners_of(delivery.sample);
  const auto camera = static_cast<std::size_t>(corners.camera);
  if (camera >= parts_.sensors.cameras.size())
    return;  // a source with more cameras than the body knows
  shared_.recorder.take(parts_.index, delivery.sample);
  if (std::holds_alternative<CameraFrame>(delivery.sample))
    shared_.recorder.take(parts_.index, corners);
  const CpuMeter meter(statistics_.update_cpu);
  auto& filter = *parts_.filter;
  observe(corners, parts_.sensors.cameras[camera].model, shared_.tags, shared_.detector, seen_);
  if (shared_.scene.wants_reset(parts_.index, seen_.exposed_at)) {
    filter.lose_motion();
    ++statistics_.restarts;
  }
  shared_.map.snapshot()->known_among(seen_, known_);
  const UpdateReport report = filter.update(seen_, {known_});
  inbox_.set_clock_shift(seen_.camera,
                         shift_to_apply(filter.clock(seen_.camera), seen_.clock_shift));
  filter.tag_beliefs(beliefs_);
  shared_.map.absorb(parts_.id, beliefs_, utc_now_ns());
  for (const auto& event : shared_.map.take_events()) {
    const bool news =
        event.kind == MapEvent::Kind::kTagAdded;  // versions are announced by the map keeper
    log::write(news ? log::Level::kInfo : log::Level::kDebug, "mapping", event.text);
  }
  hand_over_tags(seen_.exposed_at);
  std::optional<BodyEstimate> estimate;
  if (filter.running()) estimate = filter.estimate();
  if (search_) search_->corrected(filter, estimate);
  const std::uint64_t dropped = inbox_.statistics().images_dropped;
  shared_.scene.ingest(parts_.index, estimate, report, shared_.clock.now() - delivery.arrived,
                       dropped);
  doubt(report, estimate);
  ++statistics_.frames;
  statistics_.lateness.add(shared_.clock.now() - seen_.exposed_at);
  statistics_.tags_used += static_cast<std::uint64_t>(report.tags_used);
  if (estimate && estimate->anchored && report.tags_used > 0) ++statistics_.frames_with_pose;
  if (filter.running()) remember_extrinsics(seen_.exposed_at);
}

void BodyWorker::doubt(const UpdateReport& report, const std::optional<BodyEstimate>& estimate) {
  const std::string news = doubts_.add(seen_, report, estimate, beliefs_, known_);
  if (!news.empty()) log::warning("estimation", parts_.name + ": " + news);
}

void BodyWorker::hand_over_tags(Instant now) {
  if (static_cast<int>(beliefs_.size()) <= shared_.estimator.hand_over_above) return;
  const auto map = shared_.map.snapshot();
  const TagBelief* oldest = nullptr;
  for (const TagBelief& belief : beliefs_) {
    const MapTag* kept = map->find(belief.tag.tag_id);
    if (kept == nullptr || kept->component != 0 || kept->state == TagState::kQuarantined) continue;
    if (oldest == nullptr || belief.last_seen < oldest->last_seen) oldest = &belief;
  }
  if (oldest != nullptr && now - oldest->last_seen > kOutOfView)
    parts_.filter->release_tag(oldest->tag.tag_id);
}

const CornerFrame& BodyWorker::corners_of(const SensorSample& sample) {
  if (const auto* corners = std::get_if<CornerFrame>(&sample)) return *corners;
  const CpuMeter meter(statistics_.detect_cpu);
  if (!search_) search_.emplace(parts_.sensors, shared_.tags, shared_.detector, shared_.estimator);
  return search_->search(std::get<CameraFrame>(sample), beliefs_, *shared_.map.snapshot());
}

void BodyWorker::remember_extrinsics(Instant now) {
  if (learned_at_ && now - *learned_at_ < kRememberPeriod) return;
  learned_at_ = now;
  auto newest = parts_.filter->extrinsics();
  if (!clocks_announced_) announce_clocks(newest);
  const std::lock_guard lock(learned_mutex_);
  learned_ = std::move(newest);
}

void BodyWorker::announce_clocks(const std::vector<ExtrinsicsEstimate>& cameras) {
  const auto is_known = [](const ExtrinsicsEstimate& camera) {
    return camera.clock.shift_sigma_s < kKnownShift_s;
  };
  clocks_announced_ = std::all_of(cameras.begin(), cameras.end(), is_known);
  if (!clocks_announced_) return;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    if (std::abs(cameras[k].clock.shift_s) < kWorthSaying_s) continue;
    log::info("estimation", parts_.name + ": " +
                                calibration_text(k, cameras[k], parts_.sensors.cameras[k]) +
                                "; its stamps are corrected by that");
  }
}

std::vector<std::string> BodyWorker::learned_text() const {
  std::vector<std::string> lines;
  const auto cameras = learned();
  for (std::size_t k = 0; k < cameras.size() && k < parts_.sensors.cameras.size(); ++k)
    lines.push_back(calibration_text(k, cameras[k], parts_.sensors.cameras[k]));
  return lines;
}

BodyStatistics BodyWorker::statistics() const {
  BodyStatistics all = statistics_;
  if (search_) all.search = search_->statistics();
  return all;
}

std::vector<ExtrinsicsEstimate> BodyWorker::learned() const {
  const std::lock_guard lock(learned_mutex_);
  return learned_;
}

std::string BodyStatistics::text() const {
  const auto per = [](Duration cpu, std::uint64_t runs) {
    return runs == 0 ? 0.0 : to_seconds(cpu) * 1e3 / static_cast<double>(runs);
  };
  std::ostringstream line;
  line.precision(3);
  line << frames << " frames (" << frames_with_pose << " with pose), " << tags_used
       << " tags used, " << imu_samples << " IMU samples; CPU per frame: detect "
       << per(detect_cpu, frames) << " ms, update " << per(update_cpu, frames) << " ms, propagate "
       << per(propagate_cpu, frames) << " ms; dropped: " << merger.images_dropped
       << " images when busy, " << merger.late_dropped << " late, " << merger.backwards_dropped
       << " backwards, " << merger.bad_dropped << " bad; " << restarts << " restarts";
  const auto late_ms = [this](double share) { return to_seconds(lateness.quantile(share)) * 1e3; };
  line << "; exposure to update " << late_ms(0.5) << " ms (p99 " << late_ms(0.99) << ")";
  if (search.images > 0) {
    line << "; " << search.whole_images << " images searched whole, " << search.found << " of "
         << search.expected << " expected tags in their regions";
  }
  return line.str();
}

}  // namespace fiducap
