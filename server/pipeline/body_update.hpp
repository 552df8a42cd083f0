#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "capture/camera_frame.hpp"
#include "capture/sample_merger.hpp"
#include "detection/tag_observation.hpp"
#include "detection/tag_search.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "mapping/map_builder.hpp"

namespace fiducap {

/// An event of a body's estimate, for users, logs and `events.csv`.
struct BodyEvent {
  enum class Kind {
    kAnchored,       ///< The filter's axes are the workspace from now on.
    kGaugeShift,     ///< W was redefined: poses of this generation move by `shift`.
    kMapCorrection,  ///< A correction of the map has moved the body; `text`: how far.
    kReset,          ///< The filter has been reset.
    kRelocalised,    ///< Images contradicted the pose; it was found again in the map.
    kMotionLost,     ///< Too long without a tag: the body has to be found again.
    kImageRejected,  ///< There were tags, and all of them contradicted the estimate.
    kTagDropped,     ///< `tag_id` kept contradicting the others.
    kImuSilent,      ///< Images come, IMU readings do not.
    kImuBack,        ///< IMU readings come again.
    kImuUnusable,    ///< Readings cannot be in the right unit.
    kImuDoubtful,    ///< Readings or their flow are implausible.
    kImuPlausible,   ///< Readings are plausible again.
    kTurnsDisagree,  ///< Images contradict gyro or estimate; poses are withheld.
    kTurnsAgree,     ///< They fit again.
    kClockJumped,    ///< A camera's clock, by `clock_jump`.
    kMismatch,       ///< Something is not as configured and is corrected for.
    kDoubt,          ///< Tags do not fit together.
  } kind{Kind::kDoubt};
  Instant at{};
  int tag_id{-1};
  Pose shift{};            ///< Of kGaugeShift.
  std::string text{};      ///< Message; empty for kinds that need none.
  Duration clock_jump{0};  ///< Of kClockJumped: change of the camera's clock offset.
};

/// `anchored`, `gauge_shift`, …
[[nodiscard]] std::string_view name_of(BodyEvent::Kind kind);

/// Result of one image: values only. Buffers are reused from image to image.
struct BodyUpdate {
  CornerFrame corners;  ///< As detected or delivered.
  TagObservations seen;
  UpdateReport report;
  std::optional<BodyEstimate> estimate;  ///< nullopt: the filter does not run, or is `withheld`.
  bool withheld{false};                  ///< A camera contradicts the gyro.
  bool doubted{false};                   ///< Not to be published (PoseTrust) …
  bool is_untested{false};         ///< … only because images have not fitted for long enough yet.
  std::vector<TagBelief> beliefs;  ///< The tags in the body's own state.
  std::vector<int> contradicted;   ///< Tags that are not where the *map* has them.
  std::vector<KnownTag> known;     ///< This image's tags in the map.
  std::vector<ExtrinsicsEstimate> cameras;  ///< Estimated cameras, at most a second old.
  std::vector<BodyEvent> events;
  std::shared_ptr<const MotionSegment> segment;  ///< A complete one, for the map graph.

  /// The estimate that may be published.
  [[nodiscard]] const std::optional<BodyEstimate>& shown() const;
  [[nodiscard]] bool has_place() const {
    return estimate && estimate->anchored && estimate->at == seen.exposed_at;
  }
  /// … and may be published.
  [[nodiscard]] bool is_placed() const { return has_place() && !doubted; }
};

/// The map's part of an update. Refers to the update.
[[nodiscard]] MapContribution contribution_of(const MapView& view, const BodyUpdate& update);

/// Counts of a pipeline, and its CPU time.
struct PipelineStatistics {
  std::uint64_t imu_samples{};
  std::uint64_t frames{};
  std::uint64_t frames_with_pose{};  ///< In the workspace, with used tags.
  std::uint64_t tags_used{};
  std::uint64_t motion_losses{};
  Duration propagate_cpu{};  ///< IMU samples, by one of sixteen.
  Duration detect_cpu{};
  Duration update_cpu{};    ///< Correction with the corners and everything after it.
  std::uint64_t skipped{};  ///< Images left out by `skip`.
  MergerStatistics merger{};
  SearchStatistics search{};  ///< Of images; all zero when the source gives corners.

  PipelineStatistics& operator+=(const PipelineStatistics& other);
};

}  // namespace fiducap
