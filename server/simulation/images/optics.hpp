#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

/// Light on the sensor before readout: gray values 0..255 with 7 fraction bits.
struct GrayCanvas {
  static constexpr int kFraction = 128;
  /// Limit: twice the range of the sensor, so that vignetting does not undo saturation.
  static constexpr int kMost = 65535 / kFraction;

  int width{};
  int height{};
  std::vector<std::uint16_t> values;

  GrayCanvas(int w, int h)
      : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
  [[nodiscard]] std::uint16_t* row(int v) {
    return values.data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(width);
  }
};

/// Light at a place, and the automatic exposure of the camera.
///
/// The exposure follows the light at the camera with a lag: images are saturated for a moment after
/// it enters daylight and dark after it leaves. Stateless: equal instants have equal exposures.
class Lighting final {
 public:
  Lighting(const DaylightConfig& sun, double lag_s) : daylight_(sun), lag_s_(lag_s) {}

  /// Light at a place, 1 without daylight.
  [[nodiscard]] double at(const Eigen::Vector3d& p_W) const;
  /// Gain on the light at t: 1 long after the last daylight, 1 / factor long in daylight.
  [[nodiscard]] double exposure(const Trajectory& trajectory, const Pose& X_BV, double t_s) const;
  [[nodiscard]] bool even() const { return daylight_.factor == 1.0; }

 private:
  DaylightConfig daylight_;
  double lag_s_;
};

/// Undistorted ray of each pixel *corner*: the point (x, y, 1) on it, camera axes. Corner (column,
/// row) is the raw pixel (column − 0.5, row − 0.5). NaN outside the lens's field of view.
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
