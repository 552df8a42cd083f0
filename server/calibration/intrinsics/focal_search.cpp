#include "calibration/intrinsics/focal_search.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibration/intrinsics/target_poses.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kSightings = 120;
constexpr std::size_t kMostStarts = 3;
constexpr double kStep = 1.15;  // between focal lengths: the adjustment reaches further
constexpr double kLost_px = 30;
// Half of the image width is seen under this angle at the shortest and the longest focal length.
constexpr double kWidest_rad = 75 * std::numbers::pi / 180;
constexpr double kWidestFisheye_rad = 100 * std::numbers::pi / 180;
constexpr double kNarrowest_rad = 4 * std::numbers::pi / 180;

/// Sightings spread evenly over the recording.
std::vector<const TargetSighting*> sample(const CalibrationData& data) {
  std::vector<const TargetSighting*> all;
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& sighting : view.sightings) all.push_back(&sighting);
  if (all.size() <= kSightings) return all;
  std::vector<const TargetSighting*> some;
  for (std::size_t i = 0; i < kSightings; ++i) some.push_back(all[i * all.size() / kSightings]);
  return some;
}

CameraModel bare_camera(const CalibrationData& data, Distortion kind, double focal_px) {
  CameraModel camera;
  camera.width = data.width;
  camera.height = data.height;
  camera.fu = camera.fv = focal_px;
  camera.cu = (data.width - 1) / 2.0;
  camera.cv = (data.height - 1) / 2.0;
  camera.distortion = kind;
  return camera;
}

double score(const CalibrationData& data, const std::vector<const TargetSighting*>& sightings,
             const CameraModel& camera) {
  std::vector<double> rms;
  for (const TargetSighting* sighting : sightings) {
    const auto poses =
        poses_of(data.targets[static_cast<std::size_t>(sighting->target)], *sighting, camera);
    rms.push_back(poses.empty() ? kLost_px : std::min(poses.front().rms_px, kLost_px));
  }
  double sum = 0;  // of the better nine tenths: what is wrong is wrong at every focal length
  std::sort(rms.begin(), rms.end());
  const std::size_t count = std::max<std::size_t>(1, rms.size() * 9 / 10);
  for (std::size_t i = 0; i < count; ++i) sum += rms[i];
  return sum / static_cast<double>(count);
}

}  // namespace

std::vector<FocalStart> search_focal_length(const CalibrationData& data, Distortion kind) {
  const auto sightings = sample(data);
  if (sightings.empty()) return {};
  const bool fisheye = kind == Distortion::kEquidistant;
  const double half = data.width / 2.0;
  const double shortest = fisheye ? half / kWidestFisheye_rad : half / std::tan(kWidest_rad);
  const double longest = half / std::tan(kNarrowest_rad);
  std::vector<FocalStart> tried;
  for (double f = shortest; f < longest; f *= kStep) {
    const CameraModel camera = bare_camera(data, kind, f);
    tried.push_back({camera, score(data, sightings, camera)});
  }
  std::vector<FocalStart> starts;
  for (std::size_t i = 0; i < tried.size(); ++i) {
    const bool left = i == 0 || tried[i].rms_px <= tried[i - 1].rms_px;
    const bool right = i + 1 == tried.size() || tried[i].rms_px <= tried[i + 1].rms_px;
    if (left && right && tried[i].rms_px < kLost_px) starts.push_back(tried[i]);
  }
  std::sort(starts.begin(), starts.end(),
            [](const auto& a, const auto& b) { return a.rms_px < b.rms_px; });
  if (starts.size() > kMostStarts) starts.resize(kMostStarts);
  return starts;
}

}  // namespace fiducap
