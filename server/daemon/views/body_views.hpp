#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "daemon/views/camera_post.hpp"
#include "pipeline/body_pipeline.hpp"

namespace fiducap {

/// A body's part of the camera views, on its worker's thread: what is watched is left for those who
/// make pictures, at most as often as wished. While nobody watches it looks at one number per
/// image. Allocates nothing after warm-up; keeps at most two images per camera.
class BodyViews final {
 public:
  /// @param cameras  of the body, in its order   All outlive this.
  BodyViews(std::vector<CameraPost*> cameras, Doorbell& bell)
      : cameras_(cameras.size()), bell_(&bell) {
    for (std::size_t i = 0; i < cameras.size(); ++i) cameras_[i].post = cameras[i];
  }

  /// Before the pipeline takes the sample, and with it the image.
  void note(const SensorSample& sample);
  /// After. @param map  that the pipeline was given
  void show(const BodyPipeline& pipeline, const BodyUpdate& update, const TagMap& map);

 private:
  struct Camera {
    CameraPost* post{};
    std::optional<Instant> due_at;   ///< The next view …
    std::optional<Instant> last_at;  ///< … and the last image.
    double period_s{0};              ///< Of the images, smoothed; 0: not known.
  };
  void note(int camera, Instant at, const std::shared_ptr<const GrayImage>& image);

  std::vector<Camera> cameras_;
  Doorbell* bell_;
  Camera* chosen_{nullptr};  ///< Whose image is to be shown.
  std::shared_ptr<const GrayImage> image_;
};

}  // namespace fiducap
