#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/duration_histogram.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/bodies/body_inbox.hpp"
#include "daemon/session_recorder.hpp"
#include "estimation/body_filter.hpp"
#include "mapping/map_builder.hpp"
#include "pipeline/guided_search.hpp"
#include "pipeline/tag_doubts.hpp"
#include "scene/scene.hpp"

namespace fiducap {

/// What one body brings.
struct BodyParts {
  std::size_t index{};  ///< In the scene.
  int id{};             ///< In the map and on the wires.
  std::string name;
  BodySensors sensors;
  std::unique_ptr<SensorSource> source;
  std::unique_ptr<BodyFilter> filter;
};

/// What all bodies share.
struct SharedParts {
  const TagSetConfig& tags;
  const DetectorConfig& detector;
  MapBuilder& map;
  Scene& scene;
  const Clock& clock;
  SessionRecorder& recorder;
  EstimatorConfig estimator{};
};

/// What a body did and what it cost. CPU of its worker thread.
struct BodyStatistics {
  std::uint64_t frames{};
  std::uint64_t frames_with_pose{};
  std::uint64_t tags_used{};
  std::uint64_t imu_samples{};
  std::uint64_t restarts{};
  Duration detect_cpu{};
  Duration update_cpu{};  ///< Correction with the corners and everything after it.
  Duration propagate_cpu{};
  MergerStatistics merger{};
  DurationHistogram lateness{};  ///< Middle of exposure → corrected; for live sources.
  SearchStatistics search{};     ///< Of images; all zero when the source gives corners.

  [[nodiscard]] std::string text() const;  ///< One line for the log.
};

/// The life of one body's samples: a reader that waits for the device and a worker that computes.
/// Both are plain functions for a thread to run; when the source ends or fails, the body is lost
/// and everything else goes on.
class BodyWorker final {
 public:
  BodyWorker(BodyParts parts, const SharedParts& shared);

  /// Waits for the source until it ends, fails or is stopped. Readings of the IMU reach the scene
  /// at once.
  void read(std::stop_token stop);
  /// Detects, corrects, maps and publishes until the reader has finished and all is done.
  void work(std::stop_token stop);

  [[nodiscard]] const std::string& name() const { return parts_.name; }
  [[nodiscard]] bool reading() const { return reading_; }
  [[nodiscard]] bool ended() const { return ended_; }
  /// @pre work() has returned
  [[nodiscard]] BodyStatistics statistics() const;
  /// What was learned about the cameras; empty until the filter has run. From any thread.
  [[nodiscard]] std::vector<ExtrinsicsEstimate> learned() const;
  /// What was learned about the cameras, in words; a line per camera.
  [[nodiscard]] std::vector<std::string> learned_text() const;
  /// What was said about tags that do not fit together. From any thread.
  [[nodiscard]] std::vector<std::string> doubts() const { return doubts_.said(); }

 private:
  void read_samples(std::stop_token stop);
  void work_samples(std::stop_token stop);
  void take_frame(const Delivery& delivery);
  const CornerFrame& corners_of(const SensorSample& sample);
  void remember_extrinsics(Instant now);
  void announce_clocks(const std::vector<ExtrinsicsEstimate>& cameras);
  void hand_over_tags(Instant now);
  void doubt(const UpdateReport& report, const std::optional<BodyEstimate>& estimate);

  BodyParts parts_;
  SharedParts shared_;
  BodyInbox inbox_;
  std::optional<GuidedSearch>
      search_;  // built with the first image: recordings of corners need none
  TagObservations seen_;
  std::vector<KnownTag> known_;
  std::vector<TagBelief> beliefs_;
  BodyStatistics statistics_;
  TagDoubts doubts_;
  std::atomic<bool> reading_{true};
  std::atomic<bool> ended_{false};
  mutable std::mutex learned_mutex_;
  std::vector<ExtrinsicsEstimate> learned_;
  std::optional<Instant> learned_at_;
  bool clocks_announced_{false};
};

}  // namespace fiducap
