#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/numeric.hpp"
#include "capture/lens/camera_model.hpp"
#include "daemon/bodies/body_reader.hpp"
#include "daemon/map_keeper.hpp"
#include "daemon/recording/session_recorder.hpp"
#include "daemon/views/camera_preview.hpp"
#include "estimation/body_filter.hpp"
#include "mapping/map_builder.hpp"
#include "pipeline/body_pipeline.hpp"
#include "scene/scene.hpp"

namespace fiducap {

/// Counts and CPU time of a body's worker thread.
struct BodyStatistics {
  PipelineStatistics pipeline{};
  std::uint64_t images_dropped{};  ///< Because the worker was busy.
  std::uint64_t restarts{};        ///< After a failure of the pipeline.
  DurationHistogram lateness{};    ///< Middle of exposure → corrected; for live sources.

  [[nodiscard]] std::string text() const;  ///< One line for the log.
};

/// One line about the calibration of a camera by a session, e.g. `camera 0: position ±2.1 mm,
/// rotation ±0.4 mrad, clock +31.2 ±0.1 ms`. A number whose sigma is hardly smaller than configured
/// is named as not shown by the motion, with a remedy.
[[nodiscard]] std::string calibration_text(std::size_t camera, const ExtrinsicsEstimate& learned,
                                           const CameraMount& configured);

/// Parameters of one body.
struct BodyParts {
  std::size_t index{};  ///< In the scene.
  int id{};             ///< In the map and in all protocols.
  std::string name;
  PipelineSetup setup;
  std::vector<BodySource> sources;
  std::function<std::unique_ptr<BodyFilter>()> make_filter{};  ///< Empty: as configured.
  std::optional<BodyViews> views{};                            ///< nullopt: no camera views.
};

/// Shared by all bodies.
struct SharedParts {
  MapBuilder& map;
  Scene& scene;
  const Clock& clock;
  SessionRecorder& recorder;
  EventBoard& events;
};

/// Readers for the sources of one body, and the worker that drives its pipeline. All are plain
/// functions for a thread to run. When the last source of images ends, the body is lost and the
/// server continues. An exception of the pipeline restarts it, after pauses that grow to half a
/// minute.
class BodyWorker final {
 public:
  BodyWorker(BodyParts parts, const SharedParts& shared);

  /// Reads one of the sources until it ends, fails or is stopped. Readings of the IMU are passed to
  /// the scene at once.
  void read(std::size_t source, std::stop_token stop);
  /// Processes samples and updates map, scene and recorder, until the readers have finished.
  void work(std::stop_token stop);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::size_t cameras() const { return setup_.sensors.cameras.size(); }
  [[nodiscard]] std::size_t sources() const { return readers_.size(); }
  [[nodiscard]] bool reading(std::size_t source) const { return readers_[source]->reading(); }
  [[nodiscard]] const BodyPulse& pulse() const { return pulse_; }
  [[nodiscard]] UnseenTags& unseen_tags() { return pulse_.unseen; }
  /// @pre work() has returned
  [[nodiscard]] BodyStatistics statistics() const;
  /// The estimated cameras; empty until the filter has run. From any thread.
  [[nodiscard]] std::vector<ExtrinsicsEstimate> learned() const;
  [[nodiscard]] const std::vector<CameraMount>& configured_cameras() const {
    return setup_.sensors.cameras;
  }
  /// A line per camera about its calibration.
  [[nodiscard]] std::vector<std::string> learned_text() const;
  /// Messages about tags that do not fit together. From any thread.
  [[nodiscard]] std::vector<std::string> doubts() const;

 private:
  [[nodiscard]] bool pass_on(SensorSample sample);
  [[nodiscard]] std::unique_ptr<BodyPipeline> make_pipeline() const;
  [[nodiscard]] std::optional<std::string> work_until_failure(std::stop_token stop);
  [[nodiscard]] bool work_samples(std::stop_token stop);
  void restart(const std::string& why, std::stop_token stop);
  void end_conditions(std::initializer_list<std::string_view> kinds, std::string_view why);
  void process_ready_samples();
  void report_events(const BodyUpdate& update);
  void report(const BodyEvent& event);
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
  Backoff backoff_{std::chrono::milliseconds(100)};
  Instant began_at_{};  ///< Of this pipeline.
  mutable std::mutex learned_mutex_;
  std::vector<ExtrinsicsEstimate> learned_;
  std::optional<Instant> learned_at_;
  bool clocks_announced_{false};
};

/// The workers of all bodies with their threads: one per body that computes, one per source.
class BodyThreads final {
 public:
  explicit BodyThreads(const Clock& clock) : clock_(clock) {}

  void add(std::unique_ptr<BodyWorker> worker) { workers_.push_back(std::move(worker)); }
  /// @param all_ended  called once, on a worker's thread, when no body has a source any more
  void start(std::function<void()> all_ended);
  /// Stops all threads and waits for them, but not longer than `timeout` for a reader that is
  /// blocked by its device.
  /// @return false when one is left behind
  [[nodiscard]] bool stop(Duration timeout);
  /// One line per body. @pre stop() has returned
  void log_statistics() const;
  [[nodiscard]] std::vector<LearnedBody> learned() const;
  [[nodiscard]] const std::vector<std::unique_ptr<BodyWorker>>& workers() const { return workers_; }

 private:
  const Clock& clock_;
  std::vector<std::unique_ptr<BodyWorker>> workers_;
  std::atomic<std::size_t> running_{0};
  std::vector<std::jthread> computing_;
  struct ReadingThread {
    BodyWorker* body;
    std::size_t source;
    std::jthread thread;
  };
  std::vector<ReadingThread> reading_;  // die first: they feed the others
};

}  // namespace fiducap
