#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "base/expected.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/bodies/body_sources.hpp"
#include "daemon/config/config_file.hpp"
#include "estimation/body_filter.hpp"
#include "pipeline/body_pipeline.hpp"

namespace fiducap {

/// Reads calibration files and what a recording says about itself.
/// @return Error naming the file and what is wrong with it.
[[nodiscard]] Expected<BodySetup> read_body_setup(const BodyConfig& body,
                                                  const simulation::RoomConfig& room,
                                                  const SiteConfig& site = {});

/// What the configuration says about one body's pipeline.
[[nodiscard]] PipelineSetup pipeline_setup(const ServerConfig& config, const BodyConfig& body,
                                           const BodySetup& setup);

/// How what these sensors give is written to disk (see SessionRecorder).
[[nodiscard]] RecordingInfo recording_of(const BodySensors& sensors, const TagSetConfig& tags,
                                         std::optional<int> reference_tag);

/// What only a simulation knows about a body; empty for every other source.
[[nodiscard]] SimulatedTruth truth_of(const SensorSource& source, const ServerConfig& config);

/// What a recording says about the tags it is about.
[[nodiscard]] std::vector<KnownTag> tag_priors(const RecordingInfo& recording);

/// Says in the log where the recording and `tags` differ about what was printed: a wrong size
/// scales the whole room.
void warn_about_tags(const std::string& body, const RecordingInfo& recording,
                     const TagSetConfig& tags);

}  // namespace fiducap
