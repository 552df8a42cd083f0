#pragma once

#include <optional>
#include <vector>

#include "capture/sensor_source.hpp"
#include "support/results.hpp"

namespace fiducap {

/// Stamps of samples or camera frames, milliseconds.
template <typename Sample>
std::vector<std::int64_t> stamps_ms(const std::vector<Sample>& samples) {
  std::vector<std::int64_t> stamps;
  for (const Sample& one : samples) stamps.push_back(to_ns(time_of(one)) / 1'000'000);
  return stamps;
}

/// All samples of a source, at most this number.
inline std::vector<SensorSample> play_all(SensorSource& source, std::size_t at_most = 1000) {
  std::vector<SensorSample> samples;
  while (samples.size() < at_most) {
    auto sample = value_of(source.next({}));
    if (!sample) break;
    samples.push_back(std::move(*sample));
  }
  return samples;
}

}  // namespace fiducap
