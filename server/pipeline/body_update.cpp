#include "pipeline/body_update.hpp"

namespace fiducap {

std::string_view name_of(BodyEvent::Kind kind) {
  constexpr std::array<std::string_view, 18> kNames{
      "anchored",     "gauge_shift",    "map_correction", "reset",          "relocalised",
      "motion_lost",  "image_rejected", "tag_dropped",    "imu_silent",     "imu_back",
      "imu_unusable", "imu_doubtful",   "imu_plausible",  "turns_disagree", "turns_agree",
      "clock_jumped", "mismatch",       "doubt"};
  return kNames.at(static_cast<std::size_t>(kind));
}

const std::optional<BodyEstimate>& BodyUpdate::shown() const {
  static const std::optional<BodyEstimate> kNone;
  return doubted ? kNone : estimate;
}

MapContribution contribution_of(const MapView& view, const BodyUpdate& update) {
  MapContribution out{
      .body_id = view.body_id, .revision = view.revision, .at = update.seen.exposed_at};
  if (update.withheld) return out;  // sensors that contradict each other contribute nothing
  out.anchored = update.estimate && update.estimate->anchored;
  out.beliefs = update.beliefs;
  out.contradicted = update.contradicted;
  if (!update.report.start_is_open) out.fitting = update.report.named_fitting();
  out.segment = update.segment;
  return out;
}

PipelineStatistics& PipelineStatistics::operator+=(const PipelineStatistics& other) {
  imu_samples += other.imu_samples;
  frames += other.frames;
  frames_with_pose += other.frames_with_pose;
  tags_used += other.tags_used;
  motion_losses += other.motion_losses;
  propagate_cpu += other.propagate_cpu;
  detect_cpu += other.detect_cpu;
  update_cpu += other.update_cpu;
  skipped += other.skipped;
  merger += other.merger;
  search += other.search;
  return *this;
}

}  // namespace fiducap
