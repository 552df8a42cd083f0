#include "calibration/intrinsics/calibration_data.hpp"

#include <algorithm>

namespace fiducap {

std::size_t count_points(const CalibrationData& data) {
  std::size_t count = 0;
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& sighting : view.sightings) count += sighting.points.size();
  return count;
}

LensVector numbers_of(const CameraModel& camera) {
  LensVector numbers;
  numbers << camera.fu, camera.fv, camera.cu, camera.cv, 0, 0, 0, 0, 0;
  for (int i = 0; i < 5; ++i) numbers(4 + i) = camera.coefficients[static_cast<std::size_t>(i)];
  return numbers;
}

void set_numbers(CameraModel& camera, const LensVector& numbers) {
  camera.fu = numbers(0);
  camera.fv = numbers(1);
  camera.cu = numbers(2);
  camera.cv = numbers(3);
  for (int i = 0; i < 5; ++i) camera.coefficients[static_cast<std::size_t>(i)] = numbers(4 + i);
}

bool CalibrationState::defines_group(std::size_t target) const {
  return std::find(group_of.begin(), group_of.end(), group_of[target]) - group_of.begin() ==
         static_cast<std::ptrdiff_t>(target);
}

}  // namespace fiducap
