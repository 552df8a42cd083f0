#include "daemon/bodies/body_statistics.hpp"

#include <sstream>

namespace fiducap {

std::string BodyStatistics::text() const {
  const PipelineStatistics& p = pipeline;
  const auto per_frame_ms = [&](Duration cpu) {
    return p.frames == 0 ? 0.0 : to_seconds(cpu) * 1e3 / static_cast<double>(p.frames);
  };
  std::ostringstream line;
  line.precision(3);
  line << p.frames << " frames (" << p.frames_with_pose << " with pose), " << p.tags_used
       << " tags used, " << p.imu_samples << " IMU samples; CPU per frame: detect "
       << per_frame_ms(p.detect_cpu) << " ms, update " << per_frame_ms(p.update_cpu)
       << " ms, propagate " << per_frame_ms(p.propagate_cpu) << " ms; dropped: " << images_dropped
       << " images when busy, " << p.merger.late_dropped << " late, " << p.merger.backwards_dropped
       << " backwards, " << p.merger.far_dropped << " far ahead, " << p.merger.bad_dropped
       << " bad; " << p.motion_losses << " restarts, " << new_beginnings << " after failures";
  const auto late_ms = [this](double share) { return to_seconds(lateness.quantile(share)) * 1e3; };
  line << "; exposure to update " << late_ms(0.5) << " ms (p99 " << late_ms(0.99) << ")";
  if (p.search.images > 0) {
    line << "; " << p.search.whole_images << " images searched whole, " << p.search.found << " of "
         << p.search.expected << " expected tags in their regions";
  }
  return line.str();
}

}  // namespace fiducap
