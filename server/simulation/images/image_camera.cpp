#include "simulation/images/image_camera.hpp"

#include <algorithm>

#include "base/expected.hpp"
#include "simulation/random.hpp"

namespace fiducap::simulation {

namespace {

constexpr std::size_t kNoiseLength = 1 << 15;
constexpr double kStillPixels = 0.5;        // motion within an exposure that is drawn without blur
constexpr double kPixelsPerExposure = 0.6;  // step of the exposures that are averaged otherwise

std::vector<std::uint16_t> make_vignette(const CameraModel& model, double darkening) {
  const double cu = 0.5 * (model.width - 1);
  const double cv = 0.5 * (model.height - 1);
  std::vector<std::uint16_t> light;
  for (int v = 0; v < model.height; ++v) {
    for (int u = 0; u < model.width; ++u) {
      const double share = ((u - cu) * (u - cu) + (v - cv) * (v - cv)) / (cu * cu + cv * cv + 1e-9);
      light.push_back(static_cast<std::uint16_t>(65535 * (1 - darkening * share)));
    }
  }
  return light;
}

std::vector<std::int16_t> make_noise(double sigma, int width) {
  Random random(0, Purpose::kPixelNoise);
  std::vector<std::int16_t> noise;
  for (std::size_t i = 0; i < kNoiseLength; ++i)
    noise.push_back(static_cast<std::int16_t>(std::clamp(sigma * random.normal(), -100.0, 100.0) *
                                              GrayCanvas::kFraction));
  for (int i = 0; i < width; ++i)
    noise.push_back(noise[static_cast<std::size_t>(i) % kNoiseLength]);
  return noise;
}

}  // namespace

ImageCamera::ImageCamera(const CameraMount& mount, const CameraSimulation& settings,
                         const RoomLook& room, TagFamily family, const DaylightConfig& sun)
    : mount_(mount),
      settings_(settings),
      lighting_(sun, settings.exposure_lag_s),
      rays_(mount.model),
      backdrop_(room, rays_, mount.model.fu),
      tags_(mount.model, rays_, std::move(family)),
      canvas_(mount.model.width, mount.model.height),
      vignette_(make_vignette(mount.model, settings.vignetting)),
      noise_(make_noise(settings.pixel_noise, mount.model.width)),
      next_row_(mount.model.height) {}

void ImageCamera::begin(const ImageKey& key, const Trajectory& trajectory, double middle_s,
                        const std::vector<RecordedTag>& tags) {
  const double exposure = lighting_.exposure(trajectory, mount_.X_BV, middle_s);
  const auto camera_at = [&](double share) {
    return trajectory.at(middle_s + share * exposure * settings_.exposure_s).X_WB * mount_.X_BV;
  };
  const int count = exposures_needed(camera_at(-0.5), camera_at(0.5), tags);
  std::array<Pose, TagRenderer::kMostExposures> exposures;
  for (int i = 0; i < count; ++i)
    exposures[static_cast<std::size_t>(i)] = camera_at((i + 0.5) / count - 0.5);
  tags_.place(tags, std::span(exposures).first(static_cast<std::size_t>(count)), lighting_,
              exposure);
  backdrop_.look_from(camera_at(0), lighting_, exposure);
  key_ = key;
  next_row_ = 0;
  image_ = pool_.acquire();
  image_->resize(canvas_.width, canvas_.height);
}

int ImageCamera::exposures_needed(const Pose& X_WV_open, const Pose& X_WV_closed,
                                  const std::vector<RecordedTag>& tags) const {
  const Pose X_VW_open = X_WV_open.inverse();
  const Pose X_VW_closed = X_WV_closed.inverse();
  const CameraModel& model = mount_.model;
  double moved = 0;
  for (const RecordedTag& tag : tags) {
    const auto before = model.project(X_VW_open * tag.X_WT.p);
    const auto after = model.project(X_VW_closed * tag.X_WT.p);
    if (!before || !after) continue;
    // Only tags in the image: outside of it image motion is fast.
    const bool seen = before->x() > 0 && before->y() > 0 && before->x() < model.width &&
                      before->y() < model.height;
    if (seen) moved = std::max(moved, (*after - *before).norm());
  }
  if (moved < kStillPixels) return 1;
  return std::min(TagRenderer::kMostExposures, 1 + static_cast<int>(moved / kPixelsPerExposure));
}

bool ImageCamera::draw(int rows) {
  const int last = std::min(canvas_.height, next_row_ + rows);
  if (next_row_ < last) {
    backdrop_.draw(next_row_, last, canvas_);
    tags_.draw(next_row_, last, canvas_);
    read_out(next_row_, last);
    next_row_ = last;
  }
  return next_row_ == canvas_.height;
}

void ImageCamera::read_out(int first, int last) {
  const auto width = static_cast<std::size_t>(canvas_.width);
  for (int v = first; v < last; ++v) {
    Random random(key_.seed, Purpose::kPixelNoise, static_cast<std::uint64_t>(key_.camera),
                  key_.k * 65536 + static_cast<std::uint64_t>(v));
    const std::int16_t* noise = noise_.data() + random.bits() % kNoiseLength;
    const std::uint16_t* light = vignette_.data() + static_cast<std::size_t>(v) * width;
    const std::uint16_t* in = canvas_.row(v);
    std::uint8_t* out = image_->pixels.data() + static_cast<std::size_t>(v) * width;
    for (std::size_t u = 0; u < width; ++u) {
      const auto dimmed =
          static_cast<std::int32_t>((static_cast<std::uint32_t>(in[u]) * light[u]) >> 16);
      const std::int32_t gray =
          (dimmed + noise[u] + GrayCanvas::kFraction / 2) / GrayCanvas::kFraction;
      out[u] = static_cast<std::uint8_t>(std::clamp(gray, 0, 255));
    }
  }
}

std::shared_ptr<const GrayImage> ImageCamera::take() {
  FIDUCAP_ASSERT(image_ != nullptr && next_row_ == canvas_.height);
  return std::move(image_);
}

}  // namespace fiducap::simulation
