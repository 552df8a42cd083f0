#include "pipeline/body_update.hpp"

namespace fiducap {

std::string_view name_of(BodyEvent::Kind kind) {
  switch (kind) {
    case BodyEvent::Kind::kAnchored:
      return "anchored";
    case BodyEvent::Kind::kGaugeShift:
      return "gauge_shift";
    case BodyEvent::Kind::kMapCorrection:
      return "map_correction";
    case BodyEvent::Kind::kReset:
      return "reset";
    case BodyEvent::Kind::kRelocalised:
      return "relocalised";
    case BodyEvent::Kind::kMotionLost:
      return "motion_lost";
    case BodyEvent::Kind::kImageRejected:
      return "image_rejected";
    case BodyEvent::Kind::kTagDropped:
      return "tag_dropped";
    case BodyEvent::Kind::kImuSilent:
      return "imu_silent";
    case BodyEvent::Kind::kImuBack:
      return "imu_back";
    case BodyEvent::Kind::kImuUnusable:
      return "imu_unusable";
    case BodyEvent::Kind::kImuDoubtful:
      return "imu_doubtful";
    case BodyEvent::Kind::kImuPlausible:
      return "imu_plausible";
    case BodyEvent::Kind::kTurnsDisagree:
      return "turns_disagree";
    case BodyEvent::Kind::kTurnsAgree:
      return "turns_agree";
    case BodyEvent::Kind::kClockJumped:
      return "clock_jumped";
    case BodyEvent::Kind::kMismatch:
      return "mismatch";
    case BodyEvent::Kind::kDoubt:
      return "doubt";
  }
  return "doubt";
}

const std::optional<BodyEstimate>& BodyUpdate::shown() const {
  static const std::optional<BodyEstimate> kNone;
  return doubted ? kNone : estimate;
}

MapContribution contribution_of(int body_id, const BodyUpdate& update) {
  // What a body makes of sensors that contradict each other is no knowledge.
  if (update.withheld) return {.body_id = body_id, .at = update.seen.exposed_at, .anchored = false};
  return {.body_id = body_id,
          .at = update.seen.exposed_at,
          .anchored = update.estimate && update.estimate->anchored,
          .beliefs = update.beliefs,
          .contradicted = update.contradicted,
          .fitting =
              update.report.start_is_open ? std::span<const int>{} : update.report.named_fitting(),
          .segment = update.segment};
}

}  // namespace fiducap
