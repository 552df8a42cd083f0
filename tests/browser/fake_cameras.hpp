#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "capture/gray_image.hpp"
#include "daemon/views/camera_preview.hpp"
#include "unit/detection/drawn_tag.hpp"

namespace fiducap {

/// A camera for each robot, with drawn pictures: two moving tags and a dark square. Detection and
/// all that follows are the server's own.
class FakeCameras final {
 public:
  static constexpr int kWidth = 480;
  static constexpr int kHeight = 320;

  FakeCameras(int bodies, const Clock& clock)
      : clock_(clock), preview_(TagSetConfig{}, DetectorConfig{}, clock) {
    for (int i = 0; i < bodies; ++i) {
      PipelineSetup setup;
      CameraMount mount;
      mount.model = {kWidth, kHeight, 400, 400, 239.5, 159.5, Distortion::kNone, {}};
      mount.rate_hz = kRate_hz;
      setup.sensors.cameras = {mount};
      BodyViews views = preview_.add(i + 1, setup.sensors);
      bodies_.push_back({std::make_unique<BodyPipeline>(std::move(setup)), std::move(views)});
    }
    making_ = std::jthread([this](std::stop_token stop) { preview_.run(std::move(stop)); });
  }

  [[nodiscard]] CameraPreview& preview() { return preview_; }
  static constexpr double kRate_hz = 10;  ///< Of `expose`.
  void expose() {
    const Instant now = clock_.now();
    const int slid = static_cast<int>(20 * std::sin(to_seconds(now.time_since_epoch())));
    auto image = std::make_shared<GrayImage>(white_wall(kWidth, kHeight, 200));
    draw_tag(*image, 4, 60 + slid, 60, 14, 30, 210);
    draw_tag(*image, 9, 300 - slid, 100, 9, 30, 210);
    draw_square(*image, 220, 220, 60, 40);
    const MapView view{std::make_shared<const TagMap>()};
    for (Body& body : bodies_) {
      if (!body.pipeline->push(CameraFrame{0, now, image})) continue;
      while (const SensorSample* sample = body.pipeline->next()) {
        body.views.note(*sample);
        if (const BodyUpdate* update = body.pipeline->take(view))
          body.views.show(*body.pipeline, *update, *view.map);
      }
    }
  }

 private:
  struct Body {
    std::unique_ptr<BodyPipeline> pipeline;
    BodyViews views;
  };

  const Clock& clock_;
  CameraPreview preview_;
  std::vector<Body> bodies_;
  std::jthread making_;
};

}  // namespace fiducap
