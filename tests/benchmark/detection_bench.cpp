#include <cstdio>

#include "bench.hpp"
#include "detection/observe.hpp"
#include "detection/tag_detector.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::bench {
namespace {

/// Rendered images of a robot that walks through the simulated hall.
std::vector<CameraFrame> rendered_images(int count) {
  CameraMount camera;
  camera.model = {
      752, 480, 460, 460, 376, 240, Distortion::kRadialTangential, {-0.28, 0.07, 2e-4, 2e-5, 0}};
  camera.X_BV = simulation::forward_camera();
  camera.rate_hz = 2;  // far apart, so that no image repeats the one before
  simulation::SimulatedBodyConfig body;
  body.cameras = {camera};
  body.has_imu = false;
  body.trajectory.duration_s = count / camera.rate_hz;
  const auto source = simulation::make_simulated_source({}, body, instant_from_ns(0), nullptr);
  std::vector<CameraFrame> images;
  while (source && static_cast<int>(images.size()) < count) {
    auto sample = (*source)->next({});
    if (!sample || !*sample) break;
    if (const auto* image = std::get_if<CameraFrame>(&**sample)) images.push_back(*image);
  }
  return images;
}

}  // namespace

void bench_detection(const Options& options, std::vector<Row>& rows) {
  const std::vector<CameraFrame> images = rendered_images(options.repeats(60));
  for (const double decimate : {2.0, 1.0}) {
    DetectorConfig config;
    config.decimate = decimate;
    TagDetector detector({}, config);
    std::vector<double> times_us;
    std::size_t tags = 0;
    for (const CameraFrame& image : images) {
      const Duration begin = thread_cpu_time();
      tags += detector.detect(image).tags.size();
      times_us.push_back(to_seconds(thread_cpu_time() - begin) * 1e6);
    }
    char remark[64];
    std::snprintf(
        remark, sizeof remark, "%.1f tags per image",
        images.empty() ? 0.0 : static_cast<double>(tags) / static_cast<double>(images.size()));
    rows.push_back(row_of(decimate > 1 ? "detect, decimate 2" : "detect, decimate 1",
                          "image 752x480", std::move(times_us), remark));
  }
}

}  // namespace fiducap::bench
