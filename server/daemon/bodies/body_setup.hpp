#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/config/config_file.hpp"
#include "estimation/body_filter.hpp"
#include "middleware/participant.hpp"
#include "pipeline/body_pipeline.hpp"

namespace fiducap {

/// A body's sensors after every file that its configuration names has been read.
struct BodySetup {
  BodySensors sensors;
  std::optional<RecordingInfo> recording;
};

/// Reads calibration files and what a recording says about itself.
/// @return Error naming the file and what is wrong with it.
[[nodiscard]] Expected<BodySetup> read_body_setup(const BodyConfig& body,
                                                  const simulation::RoomConfig& room);

/// What the configuration says about one body's pipeline.
[[nodiscard]] PipelineSetup pipeline_setup(const ServerConfig& config, const BodyConfig& body,
                                           const BodySetup& setup);

/// How what these sensors give is written to disk (see SessionRecorder).
[[nodiscard]] RecordingInfo recording_of(const BodySensors& sensors, const TagSetConfig& tags,
                                         std::optional<int> reference_tag);

/// What only a simulation knows about a body; empty for every other source.
[[nodiscard]] SimulatedTruth truth_of(const SensorSource& source, const BodyConfig& body,
                                      const ServerConfig& config);

/// Opens the samples themselves, in real time.
/// @param start   of simulated motion: the same for all bodies, so that they share one time
/// @param motion  of a simulated body; nullptr: as configured
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_source(
    const BodyConfig& body, const BodySetup& setup, const simulation::RoomConfig& room,
    Instant start, const Clock& clock, std::unique_ptr<simulation::Trajectory> motion = nullptr);

/// The samples of a body with a ros source. Lenses that the configuration does not describe are
/// asked for and put into `setup`; without them there is no body, so this may take a while.
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_ros_body(
    const BodyConfig& body, BodySetup& setup, std::shared_ptr<dds::Participant> participant,
    const Clock& clock);

/// What a recording says about the tags it is about.
[[nodiscard]] std::vector<KnownTag> tag_priors(const RecordingInfo& recording);

/// Says in the log where the recording and `tags` differ about what was printed: a wrong size
/// scales the whole room.
void warn_about_tags(const std::string& body, const RecordingInfo& recording,
                     const TagSetConfig& tags);

/// Stands in for a source that could not be opened: gives nothing but this error.
[[nodiscard]] std::unique_ptr<SensorSource> failed_source(Error error);

/// Everything that can be known about a configuration without starting it: there is a body, and all
/// files that the configuration names can be read. The rules of the values were checked by
/// load_config.
[[nodiscard]] std::vector<ConfigFault> check_files(const ServerConfig& config);

}  // namespace fiducap
