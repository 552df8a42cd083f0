#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/bodies/body_inbox.hpp"
#include "daemon/bodies/body_pulse.hpp"
#include "daemon/bodies/body_reader.hpp"
#include "daemon/bodies/body_statistics.hpp"
#include "daemon/recording/session_recorder.hpp"
#include "daemon/views/body_views.hpp"
#include "mapping/map_builder.hpp"
#include "pipeline/body_pipeline.hpp"
#include "scene/scene.hpp"

namespace fiducap {

/// What one body brings.
struct BodyParts {
  std::size_t index{};  ///< In the scene.
  int id{};             ///< In the map and on the wires.
  std::string name;
  PipelineSetup setup;
  std::vector<BodySource> sources;
  std::function<std::unique_ptr<BodyFilter>()> make_filter{};  ///< Empty: as the setup says.
  std::optional<BodyViews> views{};                            ///< nullopt: nobody can watch.
};

/// What all bodies share.
struct SharedParts {
  MapBuilder& map;
  Scene& scene;
  const Clock& clock;
  SessionRecorder& recorder;
  EventBoard& events;
};

/// The life of one body's samples: a reader for each of its sources that waits for the device, and
/// a worker that drives the body's pipeline. All are plain functions for a thread to run. When the
/// last source of images ends, the body is lost and everything else goes on; what the pipeline
/// throws makes it begin anew, after pauses that grow to half a minute.
class BodyWorker final {
 public:
  BodyWorker(BodyParts parts, const SharedParts& shared);

  /// Waits for one of the sources until it ends, fails or is stopped. Readings of the IMU reach the
  /// scene at once.
  void read(std::size_t source, std::stop_token stop);
  /// Works on what was read, tells map, scene and recorder, until the readers have finished.
  void work(std::stop_token stop);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::size_t cameras() const { return setup_.sensors.cameras.size(); }
  [[nodiscard]] std::size_t sources() const { return readers_.size(); }
  [[nodiscard]] bool reading(std::size_t source) const { return readers_[source]->reading(); }
  [[nodiscard]] const BodyPulse& pulse() const { return pulse_; }
  /// @pre work() has returned
  [[nodiscard]] BodyStatistics statistics() const;
  /// What was learned about the cameras; empty until the filter has run. From any thread.
  [[nodiscard]] std::vector<ExtrinsicsEstimate> learned() const;
  /// The cameras as they were told.
  [[nodiscard]] const std::vector<CameraMount>& told_cameras() const {
    return setup_.sensors.cameras;
  }
  /// What was learned about the cameras, in words; a line per camera.
  [[nodiscard]] std::vector<std::string> learned_text() const;
  /// What was said about tags that do not fit together. From any thread.
  [[nodiscard]] std::vector<std::string> doubts() const;

 private:
  [[nodiscard]] bool pass_on(SensorSample sample);
  [[nodiscard]] std::unique_ptr<BodyPipeline> make_pipeline() const;
  [[nodiscard]] std::optional<std::string> work_until_failure(std::stop_token stop);
  [[nodiscard]] bool work_samples(std::stop_token stop);
  void begin_anew(const std::string& why, std::stop_token stop);
  void let_go_of_pipeline();
  void end_conditions(std::initializer_list<std::string_view> kinds, std::string_view why);
  void work_on_what_is_due();
  void publish(const BodyUpdate& update, const MapView& view);
  void tell_map(const BodyUpdate& update, const MapView& view);
  void tell_people(const BodyUpdate& update);
  [[nodiscard]] bool tell_of_sensors(const BodyEvent& event);
  void count(const BodyUpdate& update);
  void remember_cameras(const BodyUpdate& update);
  void announce_clocks(const std::vector<ExtrinsicsEstimate>& cameras);
  [[nodiscard]] Instant arrival_of(Instant stamp) const;
  [[nodiscard]] bool is_stale(const SensorSample& sample) const;
  [[nodiscard]] std::uint64_t images_left_out() const;

  struct Arrival {
    Instant stamp{};  ///< Of the device.
    Instant arrived{};
  };

  std::size_t index_;
  int id_;
  std::string name_;
  SharedParts shared_;
  const PipelineSetup setup_;
  std::function<std::unique_ptr<BodyFilter>()> make_filter_;
  std::optional<BodyViews> views_;
  mutable std::mutex pipeline_mutex_;       ///< Held to replace it, and by others to read.
  std::unique_ptr<BodyPipeline> pipeline_;  ///< nullptr: made with the next sample.
  BodyInbox inbox_;
  std::vector<Delivery> taken_;
  std::array<Arrival, 64> arrivals_{};  ///< Of the newest images.
  std::size_t next_arrival_{0};
  BodyStatistics statistics_;  ///< Of the pipeline: of those before this one.
  BodyPulse pulse_;
  std::vector<std::unique_ptr<BodyReader>> readers_;
  std::atomic<int> image_readers_{0};  ///< That still read.
  Duration pause_;                     ///< Before the next new beginning.
  Instant began_at_{};                 ///< Of this pipeline.
  bool failed_{false};                 ///< And not back yet.
  mutable std::mutex learned_mutex_;
  std::vector<ExtrinsicsEstimate> learned_;
  std::optional<Instant> learned_at_;
  bool clocks_announced_{false};
};

}  // namespace fiducap
