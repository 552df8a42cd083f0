#include "capture/video/live_video.hpp"

#include <utility>

namespace fiducap::video {

LiveVideo::LiveVideo(std::unique_ptr<VideoStream> stream, const CameraDeviceConfig& config,
                     const Clock& clock)
    : stream_(std::move(stream)),
      name_(config.open),
      before_arrival_(from_seconds(config.latency_s + config.exposure_s / 2) - config.time_shift),
      clock_(clock) {}

Expected<std::optional<SensorSample>> LiveVideo::next(std::stop_token stop) {
  while (!stop.stop_requested()) {
    if (!stream_->grab())
      return fail(ErrorCode::kClosed, "gives no more images; is it still plugged in?", name_);
    const Instant exposed_at = clock_.now() - before_arrival_;
    auto image = stream_->image();
    if (!image) return tl::unexpected(image.error());
    // Two buffered images may come within one tick of the clock; the older one has its place
    // already.
    if (!*image || (last_ && exposed_at <= *last_)) continue;
    last_ = exposed_at;
    return CameraFrame{0, exposed_at, std::move(*image)};
  }
  return std::nullopt;
}

}  // namespace fiducap::video
