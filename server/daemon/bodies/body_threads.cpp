#include <algorithm>
#include <cmath>
#include <sstream>

#include <fmt/format.h>

#include "base/log.hpp"
#include "base/process.hpp"
#include "daemon/bodies/body_worker.hpp"

namespace fiducap {
namespace {

// A sigma above this share of the configured one is no improvement.
constexpr double kNothingLearned = 0.7;

std::string part(const char* what, double sigma, double configured_sigma, double unit,
                 const char* unit_name, const char* cure) {
  if (configured_sigma == 0) return fmt::format("{} taken as exact", what);
  if (sigma > kNothingLearned * configured_sigma)
    return fmt::format("{} not shown by this motion ({})", what, cure);
  return fmt::format("{} ±{:.2g} {}", what, sigma * unit, unit_name);
}

/// Of a lens that is estimated.
std::string lens_part(const LensEstimate& learned, const CameraMount& configured) {
  constexpr double kPercent = 100;
  constexpr double kAsCalibrated_sigma = 4;
  if (has_calibrated_lens(configured) &&
      std::abs(learned.offset.focal) < kAsCalibrated_sigma * configured.focal_sigma)
    return ", lens as calibrated";
  if (configured.focal_sigma > 0 && learned.focal_sigma > kNothingLearned * configured.focal_sigma)
    return ", lens not shown by this motion (see several tags from different places)";
  std::string text;
  if (learned.focal_sigma > 0)
    text = fmt::format(", focal length {:+.2f} ±{:.2g} %", kPercent * learned.offset.focal,
                       kPercent * learned.focal_sigma);
  const bool is_k1_shown =
      configured.k1_sigma == 0 || learned.k1_sigma <= kNothingLearned * configured.k1_sigma;
  if (learned.k1_sigma > 0 && is_k1_shown)
    text += fmt::format(", k1 {:+.3f} ±{:.2g}", learned.offset.k1, learned.k1_sigma);
  return text;
}

}  // namespace

std::string calibration_text(std::size_t camera, const ExtrinsicsEstimate& learned,
                             const CameraMount& configured) {
  constexpr double kMilli = 1e3;
  const double position = std::sqrt(learned.covariance.topLeftCorner<3, 3>().trace());
  const double rotation = std::sqrt(learned.covariance.bottomRightCorner<3, 3>().trace());
  const double per_axis = std::sqrt(3.0);
  std::string text = fmt::format("camera {}: ", camera) +
                     part("position", position, per_axis * configured.position_sigma_m, kMilli,
                          "mm", "turn the body about two axes") +
                     ", " +
                     part("rotation", rotation, per_axis * configured.rotation_sigma_rad, kMilli,
                          "mrad", "turn the body about two axes");
  const ClockEstimate& clock = learned.clock;
  if (clock.shift_sigma_s > 0)
    text += clock.shift_sigma_s > kNothingLearned * configured.time_shift_sigma_s
                ? std::string(", clock not shown by this motion (turn the body quickly)")
                : fmt::format(", clock {:+.2f} ±{:.2g} ms", clock.shift_s * kMilli,
                              clock.shift_sigma_s * kMilli);
  if (clock.readout_sigma_s > 0)
    text += fmt::format(", readout {:.2f} ±{:.2g} ms", clock.readout_s * kMilli,
                        clock.readout_sigma_s * kMilli);
  return text + lens_part(learned.lens, configured);
}

std::string BodyStatistics::text() const {
  const PipelineStatistics& p = pipeline;
  const auto per_frame_ms = [&](Duration cpu) {
    return p.frames == 0 ? 0.0 : to_seconds(cpu) * 1e3 / static_cast<double>(p.frames);
  };
  std::ostringstream line;
  line.precision(3);
  line << p.frames << " frames (" << p.frames_with_pose << " with pose), " << p.tags_used
       << " tags used, " << p.imu_samples << " IMU samples; CPU per frame: detect "
       << per_frame_ms(p.detect_cpu) << " ms, update " << per_frame_ms(p.update_cpu)
       << " ms, propagate " << per_frame_ms(p.propagate_cpu) << " ms; dropped: " << images_dropped
       << " images when busy, " << p.merger.late_dropped << " late, " << p.merger.backwards_dropped
       << " backwards, " << p.merger.far_dropped << " far ahead, " << p.merger.bad_dropped
       << " bad; " << p.motion_losses << " restarts, " << restarts << " after failures";
  const auto late_ms = [this](double share) { return to_seconds(lateness.quantile(share)) * 1e3; };
  line << "; exposure to update " << late_ms(0.5) << " ms (p99 " << late_ms(0.99) << ")";
  if (p.search.images > 0)
    line << "; " << p.search.whole_images << " images searched whole, " << p.search.found << " of "
         << p.search.expected << " expected tags in their regions";
  return line.str();
}

void BodyThreads::start(std::function<void()> all_ended) {
  running_ = workers_.size();
  for (const auto& worker : workers_) {
    BodyWorker* body = worker.get();
    computing_.emplace_back([this, body, all_ended](std::stop_token stop) {
      name_this_thread("work " + body->name());
      body->work(stop);
      if (--running_ == 0 && !stop.stop_requested()) all_ended();
    });
    for (std::size_t source = 0; source < body->sources(); ++source) {
      reading_.push_back({body, source, std::jthread([body, source](std::stop_token stop) {
                            name_this_thread("read " + body->name());
                            body->read(source, stop);
                          })});
    }
  }
}

bool BodyThreads::stop(Duration timeout) {
  constexpr Duration kLook = std::chrono::milliseconds(5);
  for (auto& reader : reading_) reader.thread.request_stop();
  for (auto& thread : computing_) thread.request_stop();
  for (auto& thread : computing_) thread.join();
  computing_.clear();
  const Instant until = clock_.now() + timeout;
  const auto reads = [](const auto& reader) { return reader.body->reading(reader.source); };
  while (std::ranges::any_of(reading_, reads) && clock_.now() < until)
    if (!clock_.wait_until(clock_.now() + kLook, {})) break;
  bool all = true;
  for (auto& reader : reading_) {
    if (reads(reader)) {
      log::warning("capture", reader.body->name() +
                                  ": the device does not respond; its thread is left behind");
      all = false;
    } else {
      reader.thread.join();
    }
  }
  if (all) reading_.clear();
  return all;
}

void BodyThreads::log_statistics() const {
  for (const auto& worker : workers_) {
    log::info("daemon", worker->name() + ": " + worker->statistics().text());
    for (const auto& line : worker->learned_text())
      log::info("daemon", worker->name() + ": " + line);
    for (const auto& line : worker->doubts()) log::warning("daemon", worker->name() + ": " + line);
  }
}

std::vector<LearnedBody> BodyThreads::learned() const {
  std::vector<LearnedBody> all;
  for (const auto& worker : workers_) {
    LearnedBody& body = all.emplace_back(LearnedBody{worker->name(), worker->learned()});
    for (const CameraMount& camera : worker->configured_cameras())
      body.configured_shifts.push_back(camera.time_shift);
  }
  return all;
}

}  // namespace fiducap
