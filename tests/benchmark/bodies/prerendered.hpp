#pragma once

#include <memory>
#include <vector>

#include "base/time.hpp"
#include "capture/sensor_source.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::bench {

/// What a simulated body's sensors give, rendered before anything is measured.
struct Prerendered {
  std::vector<SensorSample> samples;  ///< In order of arrival, stamped from 0.
  Duration image_latency{};
};

[[nodiscard]] Prerendered prerender(const simulation::RoomConfig& room,
                                    const simulation::SimulatedBodyConfig& body);

/// Gives them in real time from `start` on. Images are shared, not copied: what a camera's driver
/// would do is not in it.
class PrerenderedSource final : public SensorSource {
 public:
  PrerenderedSource(std::shared_ptr<const Prerendered> material, Instant start, const Clock& clock)
      : material_(std::move(material)), start_(start), clock_(clock) {}
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override;

 private:
  std::shared_ptr<const Prerendered> material_;
  Instant start_;
  const Clock& clock_;
  std::size_t next_{0};
};

}  // namespace fiducap::bench
