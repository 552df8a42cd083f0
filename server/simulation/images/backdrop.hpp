#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/pose.hpp"
#include "simulation/images/gray_canvas.hpp"
#include "simulation/images/lighting.hpp"
#include "simulation/images/ray_table.hpp"
#include "simulation/room_shape.hpp"

namespace fiducap::simulation {

/// What stands behind the tags: the walls of the room with clutter on them, the same for every
/// robot. It moves as a room moves. `clutter` is a little out of focus: it is traced at every
/// fourth pixel and interpolated in between; `sharp` is traced at every pixel corner, so that
/// nothing in the image stands still that the room does not hold.
class Backdrop final {
 public:
  Backdrop(const RoomLook& room, const RayTable& rays, double focal_px);
  /// From where the next rows are drawn. @param exposure  what light is multiplied by
  /// @pre `lighting` outlives the drawing
  void look_from(const Pose& X_WV, const Lighting& lighting, double exposure);
  /// Overwrites rows [first, last) of the canvas. Rows must be drawn downwards; each call goes on
  /// where the last ended.
  void draw(int first, int last, GrayCanvas& canvas);

 private:
  static constexpr int kLevels = 6;

  void trace_row(int coarse_row, std::vector<std::int32_t>& out) const;
  [[nodiscard]] int gray_along(const Eigen::Vector3f& direction_W) const;
  [[nodiscard]] int texel(int level, float x, float y) const;
  template <int kStep>
  void draw_row(int v, std::uint16_t* out);

  RoomBox box_;
  int step_;  ///< A ray is traced at every so-manieth pixel corner.
  const RayTable& rays_;
  float texels_per_sample_;  ///< Texels that one traced ray covers per metre of distance.
  std::array<std::vector<std::uint8_t>, kLevels>
      texture_;  ///< Square, each level half the one before.
  Eigen::Matrix3f R_WV_{Eigen::Matrix3f::Identity()};
  Eigen::Vector3f origin_{Eigen::Vector3f::Zero()};
  const Lighting* lighting_{};
  double exposure_{1.0};
  std::vector<std::int32_t> upper_;  ///< The traced rows above and below the pixel row drawn.
  std::vector<std::int32_t> lower_;
  int lower_row_{-1};
};

}  // namespace fiducap::simulation
