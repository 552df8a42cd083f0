#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/recording.hpp"
#include "detection/tag_family.hpp"
#include "simulation/images/gray_canvas.hpp"
#include "simulation/images/lighting.hpp"
#include "simulation/images/ray_table.hpp"

namespace fiducap::simulation {

/// Draws printed tags as a camera with a lens sees them: each pixel's ray is carried back onto the
/// paper and the print is averaged over the pixel's area and over the exposure. Nearer tags hide
/// farther ones; backs are not drawn.
///
/// A pixel whose four corners fall into the same module has that module's gray; any other is
/// sampled at 16 places that differ in both coordinates, so that an edge along the rows or columns
/// is as finely placed as any other.
class TagRenderer final {
 public:
  TagRenderer(const CameraModel& model, const RayTable& rays, TagFamily family);

  /// @param exposures  X_WV at equal steps through the exposure, 1..kMostExposures
  /// @param exposure   what light is multiplied by
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
    int left{}, right{}, top{}, bottom{};  ///< Pixels it can touch: [left, right) × [top, bottom).
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
    std::vector<std::int32_t> cell;  ///< Which module of the print, ring of paperlessness included.
  };

  [[nodiscard]] const std::vector<std::uint8_t>& print_of(int tag_id);
  [[nodiscard]] bool bound(const RecordedTag& tag, std::span<const Pose> exposures,
                           Placed& placed) const;
  /// @return false when some of the outline is outside of what the lens can see.
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
  std::vector<std::uint16_t>
      sum_;  ///< Gray and coverage of the rows being drawn, added over samples and exposures.
  std::vector<std::uint16_t> cover_;
};

}  // namespace fiducap::simulation
