#include "calibration/intrinsics/lens_derivative.hpp"

#include <array>

#include <ceres/jet.h>

#include "calibration/intrinsics/lens_projection.hpp"

namespace fiducap {

LensDerivative differentiate(const CameraModel& camera, const Eigen::Vector3d& p_VP) {
  using Jet = ceres::Jet<double, kLensNumbers + 3>;
  const LensVector numbers = numbers_of(camera);
  std::array<Jet, kLensNumbers> lens;
  std::array<Jet, 3> point;
  std::array<Jet, 2> px;
  for (int i = 0; i < kLensNumbers; ++i) lens[static_cast<std::size_t>(i)] = Jet(numbers(i), i);
  for (int i = 0; i < 3; ++i) point[static_cast<std::size_t>(i)] = Jet(p_VP(i), kLensNumbers + i);
  project_through(camera.distortion, lens.data(), point.data(), px.data());
  LensDerivative out;
  for (int row = 0; row < 2; ++row) {
    const Jet& coordinate = px[static_cast<std::size_t>(row)];
    out.px(row) = coordinate.a;
    out.d_lens.row(row) = coordinate.v.head<kLensNumbers>().transpose();
    out.d_point.row(row) = coordinate.v.tail<3>().transpose();
  }
  return out;
}

}  // namespace fiducap
