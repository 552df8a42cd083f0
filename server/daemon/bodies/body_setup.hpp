#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/recording/recording.hpp"
#include "daemon/bodies/body_reader.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/map_start.hpp"
#include "daemon/recording/session_files.hpp"
#include "estimation/body_filter.hpp"
#include "middleware/participant.hpp"
#include "pipeline/body_pipeline.hpp"

namespace fiducap {

/// A body's sensors, with all files that its configuration names.
struct BodySetup {
  BodySensors sensors;
  std::vector<CameraMount> configured_cameras;  ///< Before refinement by a map store.
  std::optional<RecordingInfo> recording;
};

/// What sources need beside their configuration to be opened.
struct OpeningContext {
  const simulation::RoomConfig& room;
  const Clock& clock;
  Instant simulation_start{};                        ///< Shared by all bodies.
  std::unique_ptr<simulation::Trajectory> motion{};  ///< Of a robot moved by a program.
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds{};
};

/// One of the sources of a body: of all its sensors, of one camera, or of the IMU.
struct SensorPart {
  std::optional<std::size_t> camera{};
  bool is_imu{false};
};

[[nodiscard]] inline bool gives_images(const SensorPart& part) { return !part.is_imu; }
/// As configured; never empty.
[[nodiscard]] std::vector<SensorPart> parts_of(const BodyConfig& body);
/// For messages: `source`, `camera 1`, `IMU`.
[[nodiscard]] std::string name_of(const SensorPart& part);

/// Opens the samples of one part, in real time. A source that provides lenses writes those that are
/// not configured into `setup`, which may take a while.
[[nodiscard]] OpenedSource open_source(const BodyConfig& body, const SensorPart& part,
                                       BodySetup& setup, OpeningContext context);
/// Whether it is a device, which may be unplugged or started later.
[[nodiscard]] bool may_come_back(const BodyConfig& body, const SensorPart& part);
/// Replaces a source that could not be opened: gives only this error.
[[nodiscard]] std::unique_ptr<SensorSource> failed_source(Error error);

/// Reads calibration files and the metadata of a recording. A value that cannot be read
/// stays as configured, and `faults` gets an Error with the file and its fault.
[[nodiscard]] BodySetup read_body_setup(const BodyConfig& body, const simulation::RoomConfig& room,
                                        const SiteConfig& site, std::vector<Error>& faults);
/// The same. @return the first fault
[[nodiscard]] Expected<BodySetup> read_body_setup(const BodyConfig& body,
                                                  const simulation::RoomConfig& room,
                                                  const SiteConfig& site = {});
[[nodiscard]] PipelineSetup pipeline_setup(const ServerConfig& config, const BodyConfig& body,
                                           const BodySetup& setup);
/// Metadata for a recording of these sensors (see SessionRecorder).
[[nodiscard]] RecordingInfo recording_of(const BodySensors& sensors, const TagSetConfig& tags,
                                         std::optional<int> reference_tag);
/// Empty for sources other than simulations.
[[nodiscard]] SimulatedTruth truth_of(const SensorSource& source, const ServerConfig& config);
/// Logs differences between recording and `tags`: a wrong size scales the whole map.
void warn_about_tags(const std::string& body, const RecordingInfo& recording,
                     const TagSetConfig& tags);

/// A device that may come back: when it is lost, or missing at the start, it is reopened
/// repeatedly, with pauses that grow to half a minute and are reset after a minute of samples. The
/// end of a source (a recording, a stop) stays the end.
class ReopeningSource final : public SensorSource {
 public:
  using Open = std::function<OpenedSource()>;
  struct Listener {
    std::function<void(const Error&)> lost;  ///< Once per loss, and when the reason changes.
    std::function<void()> back;              ///< When it has given samples for a few seconds.
  };
  static constexpr Duration kBackAfter = std::chrono::seconds(3);
  static constexpr Duration kShortestPause = std::chrono::milliseconds(250);

  /// @param first  as opened at the start, or the error
  /// @param clock  outlives the source
  ReopeningSource(OpenedSource first, Open open, Listener listener, const Clock& clock);

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override;

 private:
  [[nodiscard]] Expected<std::optional<SensorSample>> ask(std::stop_token stop);
  void note_sample();
  void lose(const Error& why);
  [[nodiscard]] bool wait_and_reopen(std::stop_token stop);

  std::unique_ptr<SensorSource> source_;
  Open open_;
  Listener listener_;
  const Clock& clock_;
  Backoff backoff_{kShortestPause};
  std::optional<Instant> gives_since_;  ///< Samples, without a loss.
  Instant gave_at_{};                   ///< The last one.
  std::string reported_;                ///< Reason of the loss; empty: not lost.
  std::optional<Error> at_start_;
};

/// Replaces sources and motions, see ServerOptions.
struct SourceHooks {
  std::function<std::unique_ptr<simulation::Trajectory>(const std::string& body)> motion;
  std::function<std::unique_ptr<SensorSource>(const std::string& body,
                                              std::unique_ptr<SensorSource> configured)>
      source;
};

/// Opens the sources of all bodies, and reopens those that are lost while the server runs.
class BodyOpening final {
 public:
  struct Body {
    BodySetup setup;
    std::vector<BodySource> sources;
    SimulatedTruth truth;
  };

  /// The arguments outlive this, and this the sources.
  /// @param lost  a body has no images any more; its place in the configuration
  BodyOpening(const ServerConfig& config, SourceHooks hooks, const Clock& clock, EventBoard& events,
              dds::Membership& membership, std::function<void(std::size_t)> lost);

  /// @return Error: a file that the configuration names is wrong, or no source can be opened
  [[nodiscard]] Expected<std::vector<Body>> open_all(const StartMap& start);
  [[nodiscard]] Instant simulation_start() const { return simulation_start_; }

 private:
  [[nodiscard]] Expected<Body> open_body(const BodyConfig& config, const StartMap& start);
  [[nodiscard]] OpenedSource open(const BodyConfig& config, const SensorPart& part,
                                  BodySetup& setup);
  [[nodiscard]] bool comes_back(const BodyConfig& config, const SensorPart& part) const;
  [[nodiscard]] std::unique_ptr<SensorSource> keep_open(const BodyConfig& config,
                                                        const SensorPart& part,
                                                        const BodySetup& setup,
                                                        OpenedSource source);

  const ServerConfig& config_;
  SourceHooks hooks_;
  const Clock& clock_;
  EventBoard& events_;
  dds::Membership& membership_;
  std::function<void(std::size_t)> lost_;
  Instant simulation_start_{};
  std::optional<Error> first_failure_;
  std::size_t opened_{0};  ///< Open sources, and those that may come back.
};

}  // namespace fiducap
