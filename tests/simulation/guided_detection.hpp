#pragma once

#include <memory>
#include <string>
#include <vector>

#include "capture/sensor_source.hpp"
#include "estimation/body_filter.hpp"
#include "pipeline/guided_search.hpp"

namespace fiducap {

/// What a body's worker does with images, without threads: they are searched where a filter says
/// that tags are, and the filter lives on what was found. Everything at its defaults.
class GuidedDetection final {
 public:
  /// @param filter  see make_body_filter
  GuidedDetection(const std::string& filter, const BodySensors& sensors, const TagSetConfig& tags);

  /// @return an image's corners; any other sample as it is
  [[nodiscard]] SensorSample take(const SensorSample& sample);

 private:
  BodySensors sensors_;
  TagSetConfig tags_;
  std::unique_ptr<BodyFilter> filter_;
  GuidedSearch search_;
  TagMap map_;  ///< Empty: every tag is the filter's own.
  std::vector<TagBelief> beliefs_;
  TagObservations seen_;
};

}  // namespace fiducap
