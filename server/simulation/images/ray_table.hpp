#pragma once

#include <cstddef>
#include <vector>

#include "capture/lens/camera_model.hpp"

namespace fiducap::simulation {

/// Where each pixel *corner* of a camera looks, lens taken out: the point (x, y, 1) on its ray,
/// camera axes. Corner (column, row) is the raw pixel (column − 0.5, row − 0.5). NaN where the lens
/// sees nothing.
class RayTable final {
 public:
  explicit RayTable(const CameraModel& model);

  [[nodiscard]] int columns() const { return columns_; }  ///< width + 1
  [[nodiscard]] int rows() const { return rows_; }        ///< height + 1
  [[nodiscard]] const float* x(int row) const { return x_.data() + offset(row); }
  [[nodiscard]] const float* y(int row) const { return y_.data() + offset(row); }
  /// Largest angle off the axis, rad.
  [[nodiscard]] double widest_rad() const { return widest_rad_; }

 private:
  [[nodiscard]] std::size_t offset(int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
  }
  int columns_;
  int rows_;
  std::vector<float> x_;
  std::vector<float> y_;
  double widest_rad_{0};
};

}  // namespace fiducap::simulation
