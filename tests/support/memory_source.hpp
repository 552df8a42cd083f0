#pragma once

#include <optional>
#include <span>

#include "capture/sensor_source.hpp"

namespace fiducap {

/// Returns samples that the caller owns.
class MemorySource final : public SensorSource {
 public:
  explicit MemorySource(std::span<const SensorSample> samples) : samples_(samples) {}

  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    if (next_ == samples_.size()) return std::nullopt;
    return std::optional<SensorSample>(samples_[next_++]);
  }

 private:
  std::span<const SensorSample> samples_;
  std::size_t next_{0};
};

}  // namespace fiducap
