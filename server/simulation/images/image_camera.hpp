#pragma once

#include <array>
#include <memory>
#include <vector>

#include "capture/gray_image.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_family.hpp"
#include "simulation/corner_camera.hpp"
#include "simulation/images/backdrop.hpp"
#include "simulation/images/gray_canvas.hpp"
#include "simulation/images/lighting.hpp"
#include "simulation/images/ray_table.hpp"
#include "simulation/images/tag_renderer.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

/// Renders the images of one camera: backdrop, tags, light and exposure, motion blur, vignetting,
/// pixel noise.
///
/// An image can be drawn in slices, so that a thread that also delivers IMU samples is never busy
/// for long. Allocates nothing after the first images.
class ImageCamera final {
 public:
  ImageCamera(const CameraMount& mount, const CameraSimulation& settings, const RoomLook& room,
              TagFamily family, const DaylightConfig& sun = {});

  /// Starts an image. @param middle_s  middle of the exposure, in the trajectory's time
  void begin(const ImageKey& key, const Trajectory& trajectory, double middle_s,
             const std::vector<RecordedTag>& tags);
  /// Draws the next `rows` rows. @return true when the image is complete.
  bool draw(int rows);
  /// @pre draw returned true
  [[nodiscard]] std::shared_ptr<const GrayImage> take();
  /// Rows still to be drawn of the image begun last.
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
  std::vector<std::uint16_t> vignette_;  ///< Share of the light that arrives, of 65536.
  std::vector<std::int16_t>
      noise_;  ///< Gray values · kFraction; each row starts somewhere else in it.
  GrayImagePool pool_;
  std::shared_ptr<GrayImage> image_;
  ImageKey key_;
  int next_row_;
};

}  // namespace fiducap::simulation
