#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "capture/gray_image.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_family.hpp"
#include "simulation/images/optics.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/sensor_models.hpp"

namespace fiducap::simulation {

/// Draws the textured walls, floor and ceiling of the room. Rays of texture `clutter`, a little out
/// of focus, are traced at every fourth pixel corner and interpolated; those of `sharp` at each.
class Backdrop final {
 public:
  Backdrop(const RoomLook& room, const RayTable& rays, double focal_px);
  /// Sets the camera pose of the next rows. @param exposure  gain on the light
  /// @pre `lighting` outlives the drawing
  void look_from(const Pose& X_WV, const Lighting& lighting, double exposure);
  /// Overwrites rows [first, last) of the canvas; each call continues the last one downwards.
  void draw(int first, int last, GrayCanvas& canvas);

 private:
  static constexpr int kLevels = 6;

  void trace_row(int coarse_row, std::vector<std::int32_t>& out) const;
  [[nodiscard]] int gray_along(const Eigen::Vector3f& direction_W) const;
  [[nodiscard]] int texel(int level, float x, float y) const;
  template <int kStep>
  void draw_row(int v, std::uint16_t* out);

  RoomBox box_;
  int step_;  ///< Pixel corners from one traced ray to the next.
  const RayTable& rays_;
  float texels_per_sample_;  ///< Texels that one traced ray covers per metre of distance.
  /// Square; each level has half the size of the one before.
  std::array<std::vector<std::uint8_t>, kLevels> texture_;
  Eigen::Matrix3f R_WV_{Eigen::Matrix3f::Identity()};
  Eigen::Vector3f origin_{Eigen::Vector3f::Zero()};
  const Lighting* lighting_{};
  double exposure_{1.0};
  std::vector<std::int32_t> upper_;  ///< Traced rows above and below the pixel row.
  std::vector<std::int32_t> lower_;
  int lower_row_{-1};
};

/// Draws printed tags through the lens: projects the area of each pixel onto the paper and averages
/// the print over it and over the exposure. Nearer tags hide farther ones; backs are not drawn.
///
/// A pixel whose four corners are in one module has that module's gray. Any other has 16 samples
/// that differ in both coordinates, so that edges along rows and columns are as precise as others.
class TagRenderer final {
 public:
  TagRenderer(const CameraModel& model, const RayTable& rays, TagFamily family);

  /// @param exposures  X_WV at equal steps through the exposure, 1..kMostExposures
  /// @param exposure   gain on the light
  void place(const std::vector<RecordedTag>& tags, std::span<const Pose> exposures,
             const Lighting& lighting, double exposure);
  /// Draws over rows [first, last) of the canvas.
  void draw(int first, int last, GrayCanvas& canvas);

  static constexpr int kMostExposures = 12;

 private:
  /// Ray (x, y, 1) → paper: module column, module row and w; seen from the front where w < 0.
  using Homography = std::array<float, 9>;

  struct Placed {
    const std::vector<std::uint8_t>* print{};
    double distance{};
    int left{}, right{}, top{}, bottom{};  ///< Bounding box: [left, right) × [top, bottom).
    std::size_t first_homography{};
    double gain{1.0};  ///< On the print's gray values.
  };
  struct Box {
    Eigen::Vector2d low{Eigen::Vector2d::Constant(1e9)};
    Eigen::Vector2d high{Eigen::Vector2d::Constant(-1e9)};
    void add(const Eigen::Vector2d& px, double margin) {
      low = low.cwiseMin(px - Eigen::Vector2d::Constant(margin));
      high = high.cwiseMax(px + Eigen::Vector2d::Constant(margin));
    }
  };
  /// One row of pixel corners on the paper.
  struct CornerRow {
    std::vector<float> x, y;
    std::vector<std::int32_t> cell;  ///< Module of the print; a ring around it is empty.
  };

  [[nodiscard]] const std::vector<std::uint8_t>& print_of(int tag_id);
  [[nodiscard]] bool bound(const RecordedTag& tag, std::span<const Pose> exposures,
                           Placed& placed) const;
  /// @return false when part of the outline is outside the field of view
  [[nodiscard]] bool box_by_outline(const RecordedTag& tag, const Pose& X_WV, double half,
                                    Box& box) const;
  void box_by_rays(const Homography& h, Box& box) const;
  [[nodiscard]] Homography homography(const RecordedTag& tag, const Pose& X_WV) const;
  void draw_tag(const Placed& tag, int first, int last, GrayCanvas& canvas);
  void corner_row(const Homography& h, int row, int left, int count, CornerRow& out) const;
  void add_row(const Placed& tag, int v, std::uint16_t* sum, std::uint16_t* cover) const;

  CameraModel model_;
  const RayTable& rays_;
  TagFamily family_;
  std::map<int, std::vector<std::uint8_t>> prints_;
  std::vector<Placed> placed_;
  std::vector<Homography> homographies_;
  std::size_t exposures_{1};
  CornerRow upper_;
  CornerRow lower_;
  /// Gray and coverage of the current rows, summed over samples and exposures.
  std::vector<std::uint16_t> sum_;
  std::vector<std::uint16_t> cover_;
};

/// Renders the images of one camera: backdrop, tags, exposure, motion blur, vignetting, pixel
/// noise.
///
/// Images can be drawn in slices, so that a thread that also delivers IMU samples is never busy for
/// long. Allocates nothing after the first images.
class ImageCamera final {
 public:
  ImageCamera(const CameraMount& mount, const CameraSimulation& settings, const RoomLook& room,
              TagFamily family, const DaylightConfig& sun = {});

  /// Starts an image. @param middle_s  middle of the exposure, in the trajectory's time
  void begin(const ImageKey& key, const Trajectory& trajectory, double middle_s,
             const std::vector<RecordedTag>& tags);
  /// Draws the next `rows` rows. @return true when the image is complete
  bool draw(int rows);
  /// @pre draw returned true
  [[nodiscard]] std::shared_ptr<const GrayImage> take();
  /// Rows of the image that are not drawn yet.
  [[nodiscard]] int rows_left() const { return canvas_.height - next_row_; }

 private:
  [[nodiscard]] int exposures_needed(const Pose& X_WV_open, const Pose& X_WV_closed,
                                     const std::vector<RecordedTag>& tags) const;
  void read_out(int first, int last);

  CameraMount mount_;
  CameraSimulation settings_;
  Lighting lighting_;
  RayTable rays_;
  Backdrop backdrop_;
  TagRenderer tags_;
  GrayCanvas canvas_;
  std::vector<std::uint16_t> vignette_;  ///< Transmitted share of the light, of 65536.
  std::vector<std::int16_t> noise_;      ///< Gray values · kFraction; each row has its own offset.
  GrayImagePool pool_;
  std::shared_ptr<GrayImage> image_;
  ImageKey key_;
  int next_row_;
};

}  // namespace fiducap::simulation
