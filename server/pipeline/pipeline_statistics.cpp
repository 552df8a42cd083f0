#include "pipeline/pipeline_statistics.hpp"

namespace fiducap {

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
