#include "capture/video/video_source.hpp"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "base/log.hpp"
#include "base/text.hpp"

namespace fiducap::video {
namespace {

constexpr std::uint32_t kMostLeftOutInARow = 8;
constexpr std::uint64_t kLoggedAfter = 10;  // a single pause does not count

class LiveVideo final : public SensorSource {
 public:
  LiveVideo(std::unique_ptr<VideoStream> stream, const CameraDeviceConfig& config,
            const Clock& clock)
      : stream_(std::move(stream)),
        name_(config.open),
        before_arrival_(from_seconds(config.latency_s + config.exposure_s / 2) - config.time_shift),
        clock_(clock) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (!stream_->grab())
        return fail(ErrorCode::kClosed, "gives no more images; is it still plugged in?", name_);
      const Instant exposed_at = clock_.now() - before_arrival_;
      auto image = stream_->image();
      if (!image) return tl::unexpected(image.error());
      // Two buffered images may come within one tick of the clock; the first one is kept.
      if (!*image || (last_ && exposed_at <= *last_)) continue;
      last_ = exposed_at;
      return CameraFrame{0, exposed_at, std::move(*image)};
    }
    return std::nullopt;
  }

 private:
  std::unique_ptr<VideoStream> stream_;
  std::string name_;
  Duration before_arrival_;
  const Clock& clock_;
  std::optional<Instant> last_;
};

}  // namespace

std::unique_ptr<SensorSource> make_live_source(std::unique_ptr<VideoStream> stream,
                                               const CameraDeviceConfig& config,
                                               const Clock& clock) {
  return std::make_unique<LiveVideo>(std::move(stream), config, clock);
}

VideoFile::VideoFile(std::unique_ptr<VideoStream> stream, double rate_hz,
                     const CameraDeviceConfig& config, const Clock& clock)
    : stream_(std::move(stream)), config_(config), clock_(clock) {
  constexpr double kUsual_hz = 30;
  if (config.rate_hz > 0) rate_hz = config.rate_hz;
  period_ = from_seconds(1.0 / (rate_hz > 0.01 && rate_hz < 10'000 ? rate_hz : kUsual_hz));
}

Expected<std::optional<SensorSample>> VideoFile::next(std::stop_token stop) {
  while (!stop.stop_requested()) {
    const Instant began = clock_.now();
    if (!stream_->grab()) {
      if (!config_.loop || !rewind()) return std::nullopt;
      continue;
    }
    const Duration in_video = pass_offset_ + place_of_image();
    if (leaves_out(in_video)) continue;
    auto image = stream_->image();
    if (!image) return tl::unexpected(image.error());
    if (!*image) continue;
    some_in_pass_ = true;
    ++shown_;
    work_ += clock_.now() - began;
    if (config_.paced && !started_at_) started_at_ = clock_.now() - in_video;
    const Instant due = started_at_.value_or(Instant{}) + in_video;
    if (config_.paced && !clock_.wait_until(due, stop)) return std::nullopt;
    CameraFrame frame{0, due + config_.time_shift, std::move(*image)};
    frame.lost_before = std::exchange(left_out_in_a_row_, 0);
    return frame;
  }
  return std::nullopt;
}

/// Time of the image in the file; where the decoder does not have it, of the next image in the
/// container; by counting where that is missing, too.
Duration VideoFile::place_of_image() {
  const auto is_next = [&](Duration place) {
    constexpr Duration kLongestGap = std::chrono::minutes(1);
    return last_place_ ? place > *last_place_ && place <= *last_place_ + kLongestGap
                       : place >= Duration{0};
  };
  Duration place = last_place_ ? *last_place_ + period_ : Duration{0};
  if (config_.rate_hz <= 0) {
    std::optional<Duration> given = stream_->place();
    if (last_place_ && !is_next(*given)) given = stream_->place_after(*last_place_);
    if (given && is_next(*given)) place = *given;
  }
  last_place_ = place;
  return place;
}

bool VideoFile::rewind() {
  if (!std::exchange(some_in_pass_, false)) return false;  // would never return
  pass_offset_ += *last_place_ + period_;
  last_place_.reset();
  return stream_->rewind();
}

/// Images more than a period late are left out; after too many in a row the video plays slower.
bool VideoFile::leaves_out(Duration in_video) {
  if (!started_at_) return false;
  const Duration late = clock_.now() - (*started_at_ + in_video);
  if (late <= period_) return false;
  if (left_out_in_a_row_ < kMostLeftOutInARow) {
    ++left_out_;
    ++left_out_in_a_row_;
    if (left_out_ >= kLoggedAfter && !std::exchange(has_logged_left_out_, true))
      log::warning("capture", pace_text() + ": " + std::to_string(left_out_) + " of the first " +
                                  std::to_string(shown_ + left_out_) +
                                  " are left out; use a smaller video, or a recording with "
                                  "`fiducap replay`, which is not paced");
    return true;
  }
  *started_at_ += late;
  if (!std::exchange(has_logged_slower_, true))
    log::warning("capture", pace_text() +
                                ": too slow even with images left out, so it plays slower than it "
                                "was taken; use a smaller video");
  return false;
}

std::string VideoFile::pace_text() const {
  const double work_ms = to_seconds(work_) * 1e3 / static_cast<double>(std::max(shown_, 1ul));
  return std::filesystem::path(config_.open).filename().string() + " needs " + fixed(work_ms, 0) +
         " ms to decode an image here, its images come every " +
         fixed(to_seconds(period_) * 1e3, 0) + " ms";
}

}  // namespace fiducap::video
