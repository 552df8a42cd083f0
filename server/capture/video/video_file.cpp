#include "capture/video/video_file.hpp"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "base/log.hpp"
#include "base/text.hpp"

namespace fiducap::video {
namespace {

constexpr std::uint32_t kMostLeftOutInARow = 8;
constexpr std::uint64_t kSaidAfter = 10;  // a computer that pauses once is not too slow

}  // namespace

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
    count(clock_.now() - began);
    if (config_.paced && !started_at_) started_at_ = clock_.now() - in_video;
    const Instant due = started_at_.value_or(Instant{}) + in_video;
    if (config_.paced && !clock_.wait_until(due, stop)) return std::nullopt;
    CameraFrame frame{0, due + config_.time_shift, std::move(*image)};
    frame.lost_before = std::exchange(left_out_in_a_row_, 0);
    return frame;
  }
  return std::nullopt;
}

/// The time the file gives for the image; counted where it gives none or goes backwards, so that it
/// always grows.
Duration VideoFile::place_of_image() {
  const Duration counted = last_place_ ? *last_place_ + period_ : Duration{0};
  const Duration given = stream_->place();
  const bool is_usable = config_.rate_hz <= 0 && given >= Duration{0};
  Duration place = is_usable ? given : counted;
  constexpr Duration kLongestGap = std::chrono::minutes(1);
  if (last_place_ && (place <= *last_place_ || place > *last_place_ + kLongestGap)) place = counted;
  last_place_ = place;
  return place;
}

bool VideoFile::rewind() {
  if (!std::exchange(some_in_pass_, false)) return false;  // it would spin for ever
  pass_offset_ += *last_place_ + period_;
  last_place_.reset();
  return stream_->rewind();
}

/// An image that is late by more than a period makes the next ones late, too.
bool VideoFile::leaves_out(Duration in_video) {
  if (!started_at_) return false;
  const Duration late = clock_.now() - (*started_at_ + in_video);
  if (late <= period_) return false;
  if (left_out_in_a_row_ < kMostLeftOutInARow) {
    ++left_out_;
    ++left_out_in_a_row_;
    say_left_out();
    return true;
  }
  play_slower(late);
  return false;
}

void VideoFile::say_left_out() {
  if (left_out_ < kSaidAfter || std::exchange(has_said_left_out_, true)) return;
  log::warning("capture", pace_text() + ": " + std::to_string(left_out_) + " of the first " +
                              std::to_string(shown_ + left_out_) +
                              " are left out; use a smaller video, or a recording with `fiducap "
                              "replay`, which takes the time it needs");
}

void VideoFile::play_slower(Duration by) {
  *started_at_ += by;
  if (std::exchange(has_said_slower_, true)) return;
  log::warning("capture", pace_text() +
                              ": too much even with images left out, so it plays slower than it "
                              "was taken; use a smaller video");
}

std::string VideoFile::pace_text() const {
  const double work_ms = to_seconds(work_) * 1e3 / static_cast<double>(std::max(shown_, 1ul));
  return std::filesystem::path(config_.open).filename().string() + " needs " + fixed(work_ms, 0) +
         " ms an image to be decoded here, its images come every " +
         fixed(to_seconds(period_) * 1e3, 0) + " ms";
}

void VideoFile::count(Duration work) {
  ++shown_;
  work_ += work;
}

}  // namespace fiducap::video
