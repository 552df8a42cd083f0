#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/camera_frame.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "mapping/map_builder.hpp"

namespace fiducap {

/// Something that happened to a body's estimate, for people, logs and `events.csv`.
struct BodyEvent {
  enum class Kind {
    kAnchored,       ///< The filter stands in the workspace from here on.
    kGaugeShift,     ///< W was re-defined: poses of this generation move by `shift`.
    kMapCorrection,  ///< The map has learned, and moved the body: `text` says how far.
    kReset,          ///< The filter has forgotten everything.
    kRelocalised,    ///< Images contradicted where the body was: found anew in what was learned.
    kMotionLost,     ///< Without a tag for so long that the body has to be found anew.
    kImageRejected,  ///< Tags were there, and all of them contradicted the estimate.
    kTagDropped,     ///< `tag_id` kept contradicting the others.
    kImuSilent,      ///< Images come, IMU readings do not: `text` says what follows.
    kImuBack,        ///< … and they come again.
    kImuUnusable,    ///< Its readings cannot be in the right unit: `text` says what they look like.
    kImuDoubtful,    ///< They look odd, or come oddly: `text` says how.
    kImuPlausible,   ///< … and are as they should be again.
    kTurnsDisagree,  ///< Images contradict gyro or estimate, poses are withheld: `text` says how.
    kTurnsAgree,     ///< … and does so no more.
    kClockJumped,    ///< A camera's clock, by `clock_jump`: `text` says how far.
    kMismatch,       ///< Something is not as configured, the estimate reckons with it: `text`.
    kDoubt,          ///< Tags do not fit together: `text` says how.
  } kind{Kind::kDoubt};
  Instant at{};
  int tag_id{-1};
  Pose shift;  ///< Of kGaugeShift.
  std::string
      text;  ///< Of kDoubt, kMismatch, kMapCorrection and those about the IMU and the clocks.
  Duration clock_jump{
      0};  ///< Of kClockJumped: what is to be added to the camera's stamps has grown by it.
};

/// `anchored`, `gauge_shift`, …
[[nodiscard]] std::string_view name_of(BodyEvent::Kind kind);

/// What one image did to a body: all values, nothing refers back into the pipeline. Buffers are
/// reused from image to image.
struct BodyUpdate {
  CornerFrame corners;  ///< As detected or delivered.
  TagObservations seen;
  UpdateReport report;
  std::optional<BodyEstimate> estimate;  ///< nullopt: the filter does not run, or is not believed.
  bool withheld{false};  ///< A camera contradicts the gyro: there is no estimate for that reason.
  bool doubted{false};   ///< The estimate is not to be shown (PoseTrust) …
  bool is_untested{false};  ///< … but only because images have not yet fitted for long enough.
  std::vector<TagBelief> beliefs;           ///< The tags in the body's own state.
  std::vector<int> contradicted;            ///< Tags that are not where the *map* has them.
  std::vector<KnownTag> known;              ///< What the map said about the tags of this image.
  std::vector<ExtrinsicsEstimate> cameras;  ///< What was learned about them, at most a second old.
  std::vector<BodyEvent> events;
  std::shared_ptr<const MotionSegment> segment;  ///< One that has ended, for the map graph.

  /// What clients may see of the estimate.
  [[nodiscard]] const std::optional<BodyEstimate>& shown() const;
  [[nodiscard]] bool has_place() const {
    return estimate && estimate->anchored && estimate->at == seen.exposed_at;
  }
  /// … and may be shown.
  [[nodiscard]] bool is_placed() const { return has_place() && !doubted; }
};

/// What the map hears of it. Refers to the update.
[[nodiscard]] MapContribution contribution_of(int body_id, const BodyUpdate& update);

}  // namespace fiducap
