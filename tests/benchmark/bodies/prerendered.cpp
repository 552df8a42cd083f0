#include "bodies/prerendered.hpp"

#include <utility>

namespace fiducap::bench {

Prerendered prerender(const simulation::RoomConfig& room,
                      const simulation::SimulatedBodyConfig& body) {
  Prerendered made;
  made.image_latency = from_seconds(body.camera.latency_s);
  const auto source = simulation::make_simulated_source(room, body, instant_from_ns(0), nullptr);
  while (source) {
    auto sample = (*source)->next({});
    if (!sample || !*sample) break;
    made.samples.push_back(std::move(**sample));
  }
  return made;
}

Expected<std::optional<SensorSample>> PrerenderedSource::next(std::stop_token stop) {
  if (next_ == material_->samples.size()) return std::nullopt;
  SensorSample sample = material_->samples[next_++];
  const Duration since = time_of(sample) - instant_from_ns(0);
  Instant due = start_ + since;
  if (auto* imu = std::get_if<ImuSample>(&sample)) {
    imu->sampled_at = due;
  } else if (auto* image = std::get_if<CameraFrame>(&sample)) {
    image->exposed_at = due;
    due += material_->image_latency;
  }
  if (!clock_.wait_until(due, stop)) return std::nullopt;
  return std::optional<SensorSample>(std::move(sample));
}

}  // namespace fiducap::bench
