#pragma once

#include <cstdint>
#include <string>

#include "base/duration_histogram.hpp"
#include "pipeline/body_pipeline.hpp"

namespace fiducap {

/// What a body did and what it cost. CPU of its worker thread.
struct BodyStatistics {
  PipelineStatistics pipeline{};
  std::uint64_t images_dropped{};  ///< Because the worker was busy.
  std::uint64_t new_beginnings{};  ///< After a failure inside of the pipeline.
  DurationHistogram lateness{};    ///< Middle of exposure → corrected; for live sources.

  [[nodiscard]] std::string text() const;  ///< One line for the log.
};

}  // namespace fiducap
