#include "capture/video/video_source.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "base/log.hpp"

namespace fiducap::video {
namespace {

Expected<void> to_gray(const cv::Mat& image, GrayImage& out) {
  out.resize(image.cols, image.rows);
  cv::Mat gray(image.rows, image.cols, CV_8UC1, out.pixels.data());
  const int conversion = image.type() == CV_8UC3   ? cv::COLOR_BGR2GRAY
                         : image.type() == CV_8UC4 ? cv::COLOR_BGRA2GRAY
                         : image.type() == CV_8UC2 ? cv::COLOR_YUV2GRAY_YUY2
                                                   : -1;
  if (image.type() == CV_8UC1)
    image.copyTo(gray);
  else if (image.type() == CV_16UC1)
    image.convertTo(gray, CV_8UC1, 1.0 / 256);
  else if (conversion >= 0)
    cv::cvtColor(image, gray, conversion);
  else
    return fail(ErrorCode::kUnsupported,
                "pixel format " + cv::typeToString(image.type()) + " is not supported");
  return {};
}

class OpenCvStream final : public VideoStream {
 public:
  OpenCvStream(cv::VideoCapture video, std::string name, std::string what, int backend,
               const CameraModel& camera)
      : video_(std::move(video)),
        name_(std::move(name)),
        what_(std::move(what)),
        backend_(backend),
        camera_(camera) {}

  bool grab() override { return video_.grab(); }
  Duration place() const override {
    const double given_ms = video_.get(cv::CAP_PROP_POS_MSEC);
    constexpr double kLongest_ms = 1e10;
    return std::isfinite(given_ms) && given_ms < kLongest_ms ? from_seconds(given_ms * 1e-3)
                                                             : Duration{-1};
  }
  std::optional<Duration> place_after(Duration last) override {
    constexpr Duration kRounding = std::chrono::microseconds(10);  // of milliseconds as double
    if (!stamps_) stamps_ = container_stamps(what_);
    const auto next = std::ranges::upper_bound(*stamps_, last + kRounding);
    return next == stamps_->end() ? std::nullopt : std::optional(*next);
  }
  Expected<std::shared_ptr<const GrayImage>> image() override {
    if (!video_.retrieve(decoded_) || decoded_.empty()) {
      if (++undecodable_ == 1)
        log::warning("capture", name_ + ": an image cannot be decoded; such images are left out");
      return nullptr;
    }
    if (const auto fits = fits_calibration({decoded_.cols, decoded_.rows}, camera_, name_); !fits)
      return tl::unexpected(fits.error());
    std::shared_ptr<GrayImage> gray = pool_.acquire();
    return to_gray(decoded_, *gray).map([&] { return std::move(gray); });
  }
  bool rewind() override { return video_.open(what_, backend_); }

 private:
  cv::VideoCapture video_;
  std::string name_;
  std::string what_;
  int backend_;
  CameraModel camera_;
  std::optional<std::vector<Duration>> stamps_;  ///< Read when a stamp is missing.
  cv::Mat decoded_;
  GrayImagePool pool_;
  std::uint64_t undecodable_{0};
};

const char* why_not_opened(VideoKind kind) {
  switch (kind) {
    case VideoKind::kFile:
      return "is no video that OpenCV can read";
    case VideoKind::kNetwork:
      return "cannot be reached, or gives no video: check address, user, password and network";
    case VideoKind::kPipeline:
      break;
  }
  return "is no GStreamer pipeline that starts: it must end in appsink (package "
         "gstreamer1.0-plugins-base)";
}

/// CAP_ANY would also accept a list of pictures as video, and prints errors of each backend.
int backend_of(VideoKind kind) {
  return kind == VideoKind::kPipeline ? cv::CAP_GSTREAMER : cv::CAP_FFMPEG;
}

/// A silent camera on the network is closed, to be opened again.
std::vector<int> parameters_of(VideoKind kind) {
  constexpr int kTimeout_ms = 5000;
  if (kind != VideoKind::kNetwork) return {};
  return {cv::CAP_PROP_OPEN_TIMEOUT_MSEC, kTimeout_ms, cv::CAP_PROP_READ_TIMEOUT_MSEC, kTimeout_ms};
}

}  // namespace

Expected<OpenedVideo> open_video(VideoKind kind, const std::string& name, const std::string& what,
                                 const CameraModel& camera) {
  std::error_code ignored;
  if (kind == VideoKind::kFile && !std::filesystem::is_regular_file(what, ignored))
    return fail(ErrorCode::kNotFound,
                "no such video file (a device is /dev/videoN or N, a GStreamer pipeline has a '!')",
                name);
  cv::VideoCapture video;
  video.open(what, backend_of(kind), parameters_of(kind));
  if (!video.isOpened()) return fail(ErrorCode::kUnavailable, why_not_opened(kind), name);
  // Images are not rotated, as with JPEG: the calibration is that of the sensor.
  if (kind == VideoKind::kFile) video.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
  const int width = static_cast<int>(video.get(cv::CAP_PROP_FRAME_WIDTH));
  const int height = static_cast<int>(video.get(cv::CAP_PROP_FRAME_HEIGHT));
  if (width > 0 && height > 0) {  // else not known before the first image
    if (const auto fits = fits_calibration({width, height}, camera, name); !fits)
      return tl::unexpected(fits.error());
  }
  const double rate_hz = video.get(cv::CAP_PROP_FPS);
  return OpenedVideo{
      std::make_unique<OpenCvStream>(std::move(video), name, what, backend_of(kind), camera),
      rate_hz > 0.01 && rate_hz < 10'000 ? rate_hz : 0.0};
}

}  // namespace fiducap::video
