#pragma once

#include <bitset>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/sample_merger.hpp"
#include "capture/sensor_source.hpp"
#include "estimation/segment/segment_recorder.hpp"
#include "mapping/map_builder.hpp"
#include "pipeline/body_tracker.hpp"
#include "pipeline/body_update.hpp"
#include "pipeline/contradicted_tags.hpp"
#include "pipeline/correction_ramp.hpp"
#include "pipeline/doubts.hpp"
#include "pipeline/guided_search.hpp"
#include "pipeline/imu_plausibility.hpp"
#include "pipeline/pose_trust.hpp"
#include "pipeline/rotation_agreement.hpp"

namespace fiducap {

/// All parameters of a body's pipeline.
struct PipelineSetup {
  BodySensors sensors;
  TagSetConfig tags;
  DetectorConfig detector;
  EstimatorConfig estimator;
  WorkspaceGauge gauge;
  std::string filter{"world"};
  std::vector<KnownTag> priors;  ///< Survey of tags that are estimated nevertheless.
  MergerConfig merger;           ///< `has_imu`, `cameras` and more images follow from the sensors.
  double lose_after_s{BodyLimits{}.lose_after_s};
  bool records_segments{false};           ///< For the map graph.
  bool segments_hold_every_image{false};  ///< Also images without a tag, for poses at all images.
};

/// One body's samples in, one estimate per image out: merger, detection with its forecast, filter
/// and checks.
///
/// No threads, no clock: the output depends on samples and map views only, so that live worker,
/// replay, calibration, tests and benches share this object. Detection (GuidedSearch) and tracking
/// exchange values only and could run on two computers.
///
///     pipeline.push(sample);                       // in order of arrival
///     while (pipeline.next() != nullptr)           // ready samples, in the filter's order
///       if (const BodyUpdate* update = pipeline.take(map.view(body))) …
///
/// Bounded memory; allocates nothing per sample after warm-up. Not thread-safe.
class BodyPipeline final {
 public:
  /// @param filter  nullptr: made by name, as configured
  explicit BodyPipeline(PipelineSetup setup, std::unique_ptr<BodyFilter> filter = nullptr);

  /// @return false when IMU readings pile up.
  bool push(SensorSample sample);
  /// No more samples: all that wait are ready.
  void finish();
  /// The sample that `take` will process, or nullptr when none is ready.
  [[nodiscard]] const SensorSample* next();
  [[nodiscard]] bool next_is_image();
  /// Processes it. @param view  for an image as new as possible; unused for IMU readings
  /// @pre next() != nullptr
  /// @return the result of an image, until the next call; nullptr for an IMU reading
  const BodyUpdate* take(const MapView& view);
  /// Drops an image that is too old. @pre next() != nullptr
  void skip();

  /// After the last sample: the segments not handed over with an image, one by one, then nullptr.
  [[nodiscard]] std::shared_ptr<const MotionSegment> take_last_segment() {
    if (segments_) segments_->finish(*filter_);
    return segments_ ? contradicted_.without(segments_->take()) : nullptr;
  }

  [[nodiscard]] const PipelineSetup& setup() const { return setup_; }
  [[nodiscard]] PipelineStatistics statistics() const;
  /// Messages about tags, oldest first. From any thread.
  [[nodiscard]] std::vector<std::string> doubts() const { return doubts_.texts(); }
  /// The cameras as estimated now.
  [[nodiscard]] std::vector<ExtrinsicsEstimate> cameras() const { return filter_->extrinsics(); }
  [[nodiscard]] const BodyFilter& filter() const { return *filter_; }
  [[nodiscard]] const RotationAgreement& agreement() const { return agreement_; }
  /// Predicted tags of the last image; empty: all of it was searched, or it came with corners.
  [[nodiscard]] std::span<const ExpectedTag> expected() const {
    return search_ ? search_->expected() : std::span<const ExpectedTag>();
  }
  [[nodiscard]] std::span<const FoundMismatch> mismatches() const { return found_; }
  [[nodiscard]] const LateImages& late() const { return late_; }
  /// No image so far needed detection.
  [[nodiscard]] bool source_gives_corners() const { return !search_; }

 private:
  void note_late(int camera, Instant stamp, bool was_dropped);
  void take_imu(const ImuSample& imu);
  const BodyUpdate* take_image(const MapView& view);
  const BodyUpdate* take_excluded_image();
  void find_corners(const MapView& view);
  void note_contradicted(const TagMap& map);
  void lose_motion_if_lost();
  void refresh_cameras();
  void note_carried();
  void note_events();
  void note_imu();
  void note_turns();
  void note_trust();
  void note_shown();
  void note_mismatches();
  BodyEvent& note(BodyEvent::Kind kind, std::string text = {});
  /// If there is a message.
  void report(BodyEvent::Kind kind, std::string text) {
    if (!text.empty()) note(kind, std::move(text));
  }

  PipelineSetup setup_;
  SampleMerger merger_;
  std::unique_ptr<BodyFilter> filter_;
  std::optional<GuidedSearch> search_;  ///< Built with the first image that needs it.
  std::optional<SegmentRecorder> segments_;
  ContradictedTags contradicted_;
  TagDoubts doubts_;
  ImuPlausibility plausibility_{setup_.sensors.imu ? setup_.sensors.imu->rate_hz : 0};
  RotationAgreement agreement_;
  PoseTrust trust_;
  MapCorrections corrections_;
  MismatchReporter mismatches_;
  std::vector<FoundMismatch> found_;  ///< Kept for its memory.
  LateImages late_;
  std::optional<Instant> newest_imu_;
  std::optional<SensorSample> next_;
  BodyUpdate update_;
  PipelineStatistics statistics_;
  std::optional<Instant> cameras_at_;
  std::optional<Instant> mismatches_at_;
  std::optional<Instant> rejected_at_;  ///< Last rejected tag.
  std::optional<Instant> carried_at_;   ///< Last used tag, or followed points instead.
  ImuSilence imu_silence_;
  /// Conditions as last reported. Checks only judge; here a change becomes an event.
  struct Reported {
    bool silence{false};  ///< ImuSilence.
    ImuFaults imu{};
    std::bitset<kMostCameras> late;  ///< LateImages.
    bool contradiction{false};       ///< PoseTrust.
    bool disagreement{false};        ///< A reason for which poses are withheld.
  } reported_;
  bool anchored_{false};
  int generation_{-1};
};

}  // namespace fiducap
