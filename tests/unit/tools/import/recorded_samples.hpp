#pragma once

#include <string>
#include <vector>

#include "capture/recording/recording.hpp"
#include "capture/recording/recording_source.hpp"
#include "support/results.hpp"

namespace fiducap {

/// All samples of a recording, stream by stream.
inline std::vector<SensorSample> recorded_samples(const std::string& folder) {
  static GrayImagePool pool;
  std::vector<SensorSample> all;
  for (SampleStream& stream : value_of(open_streams(value_of(read_recording_info(folder)), pool))) {
    const auto next = [&] { return std::visit([](auto& s) { return s.next(); }, stream); };
    for (auto sample = next(); sample; sample = next()) all.push_back(std::move(*sample));
  }
  return all;
}

/// Those of one kind.
template <typename Sample>
std::vector<Sample> recorded(const std::string& folder) {
  std::vector<Sample> all;
  for (const SensorSample& sample : recorded_samples(folder))
    if (const auto* one = std::get_if<Sample>(&sample)) all.push_back(*one);
  return all;
}

}  // namespace fiducap
