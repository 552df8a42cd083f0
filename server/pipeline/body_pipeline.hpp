#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/this_thread.hpp"
#include "capture/sample_merger.hpp"
#include "capture/sensor_source.hpp"
#include "estimation/segment/segment_recorder.hpp"
#include "mapping/map_builder.hpp"
#include "pipeline/agreement/pose_trust.hpp"
#include "pipeline/agreement/rotation_agreement.hpp"
#include "pipeline/body_tracker.hpp"
#include "pipeline/body_update.hpp"
#include "pipeline/guided_search.hpp"
#include "pipeline/imu_plausibility.hpp"
#include "pipeline/imu_silence.hpp"
#include "pipeline/late_images.hpp"
#include "pipeline/map_corrections.hpp"
#include "pipeline/mismatch_words.hpp"
#include "pipeline/pipeline_statistics.hpp"
#include "pipeline/tag_doubts.hpp"

namespace fiducap {

/// Everything that decides what becomes of a body's samples.
struct PipelineSetup {
  BodySensors sensors;
  TagSetConfig tags;
  DetectorConfig detector;
  EstimatorConfig estimator;
  WorkspaceGauge gauge;
  std::string filter{"world"};
  std::vector<KnownTag> priors;  ///< Survey knowledge of tags that are nevertheless estimated.
  MergerConfig merger;           ///< `has_imu`, `cameras` and more images follow from the sensors.
  double lose_after_s{BodyLimits{}.lose_after_s};
  bool records_segments{false};           ///< For the map graph.
  bool segments_hold_every_image{false};  ///< Also those without a tag: somebody asks for poses.
};

/// One body's samples in, one estimate per image out: merger, detection with its forecast, filter
/// and checks.
///
/// No threads, no clock: what comes out depends on the samples and the map views alone, so the live
/// worker, replay, calibration, tests and benches all drive this one object. Detection
/// (GuidedSearch) and tracking exchange values only, so that a network may lie between them.
///
///     pipeline.push(sample);                       // in order of arrival
///     while (pipeline.next() != nullptr)           // what is due, in the filter's order
///       if (const BodyUpdate* update = pipeline.take(map.view(body))) …
///
/// Bounded memory; allocates nothing per sample after warm-up. Not thread-safe.
class BodyPipeline final {
 public:
  /// @param filter  nullptr: made by name, as the setup says
  explicit BodyPipeline(PipelineSetup setup, std::unique_ptr<BodyFilter> filter = nullptr);

  /// @return false when IMU readings pile up without anybody taking them.
  bool push(SensorSample sample);
  /// Nothing more will come: what waits is due.
  void finish();
  /// The sample that `take` will work on, or nullptr while nothing is due.
  [[nodiscard]] const SensorSample* next();
  [[nodiscard]] bool next_is_image();
  /// Works on it. @param view  for an image as new as possible; not looked at for IMU readings
  /// @pre next() != nullptr
  /// @return what an image did, until the next call; nullptr for an IMU reading
  const BodyUpdate* take(const MapView& view);

  /// After the last sample: what was recorded of the motion and not handed over with an image,
  /// piece by piece. @return nullptr: that was all
  [[nodiscard]] std::shared_ptr<const MotionSegment> take_last_segment() {
    if (segments_) segments_->finish(*filter_);
    return segments_ ? segments_->take() : nullptr;
  }

  /// Leaves it out: an image that is too old to be of use. @pre next() != nullptr
  void skip();

  [[nodiscard]] const PipelineSetup& setup() const { return setup_; }
  [[nodiscard]] PipelineStatistics statistics() const;
  /// All doubts about tags, oldest first. From any thread.
  [[nodiscard]] std::vector<std::string> doubts() const { return doubts_.said(); }
  /// The cameras as they are known now.
  [[nodiscard]] std::vector<ExtrinsicsEstimate> cameras() const { return filter_->extrinsics(); }
  [[nodiscard]] const BodyFilter& filter() const { return *filter_; }
  /// Whether cameras and gyro see the same turns, and by how much a clock has jumped.
  [[nodiscard]] const RotationAgreement& agreement() const { return agreement_; }
  /// Where tags were looked for in the last image; empty: in all of it, or it came with corners.
  [[nodiscard]] std::span<const ExpectedTag> expected() const {
    return search_ ? search_->expected() : std::span<const ExpectedTag>();
  }
  [[nodiscard]] std::span<const FoundMismatch> mismatches() const { return found_; }
  [[nodiscard]] const LateImages& late() const { return late_; }
  /// No image has come so far whose tags had to be found.
  [[nodiscard]] bool source_gives_corners() const { return !search_; }

 private:
  void watch_turns(const SensorSample& sample);
  void note_late(int camera, Instant stamp, bool was_dropped);
  const BodyUpdate* watched_image();
  void take_imu(const ImuSample& imu);
  const BodyUpdate* take_image(const MapView& view);
  void find_corners(const MapView& view);
  void note_contradicted();
  void lose_motion_if_lost();
  void hand_over_tags(const TagMap& map);
  void refresh_cameras();
  void note_carried();
  void note_events();
  void note_imu();
  void note_imu_faults();
  void note_turns();
  void note_trust();
  void note_shown();
  void note_mismatches();
  void note(BodyEvent::Kind kind, int tag_id = -1);
  void say(BodyEvent::Kind kind, std::string text);

  PipelineSetup setup_;
  SampleMerger merger_;
  std::unique_ptr<BodyFilter> filter_;
  std::optional<GuidedSearch>
      search_;  // built with the first image: recordings of corners need none
  std::optional<SegmentRecorder> segments_;
  TagDoubts doubts_;
  ImuPlausibility plausibility_{setup_.sensors.imu ? setup_.sensors.imu->rate_hz : 0};
  RotationAgreement agreement_;
  PoseTrust trust_;
  bool disagreement_told_{false};  ///< While poses were not shown.
  MapCorrections corrections_;
  MismatchNews mismatches_;
  std::vector<FoundMismatch> found_;  ///< Kept for its memory.
  LateImages late_;
  std::optional<Instant> newest_imu_;
  TagObservations delivered_;  ///< Corners as they came, before the merger puts them in order.
  std::optional<SensorSample> next_;
  BodyUpdate update_;
  PipelineStatistics statistics_;
  std::optional<Instant> cameras_at_;
  std::optional<Instant> mismatches_at_;
  std::optional<Instant> carried_at_;  ///< The last used tag, or followed points in its stead.
  ImuSilence imu_silence_;
  bool anchored_{false};
  int generation_{-1};
};

}  // namespace fiducap
