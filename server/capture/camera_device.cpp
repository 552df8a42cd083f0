#include "capture/camera_device.hpp"

#include <cmath>
#include <filesystem>
#include <utility>

#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "base/log.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {
namespace {

// Every backend in turn (CAP_ANY) would also take a list of pictures for a video, and complains
// aloud on the way.
constexpr int kFileBackend = cv::CAP_FFMPEG;

enum class Kind { kFile, kDevice, kPipeline };

bool is_number(const std::string& text) {
  return !text.empty() && text.size() <= 3 &&
         text.find_first_not_of("0123456789") == std::string::npos;
}

Kind kind_of(const std::string& open) {
  if (open.find('!') != std::string::npos) return Kind::kPipeline;
  if (is_number(open) || open.starts_with("/dev/")) return Kind::kDevice;
  return Kind::kFile;
}

std::string size_text(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

Expected<void> check_size(const cv::Mat& image, const CameraModel& camera,
                          const std::string& open) {
  if (camera.width == 0 || (image.cols == camera.width && image.rows == camera.height)) return {};
  return fail(ErrorCode::kInvalid,
              "gives images of " + size_text(image.cols, image.rows) + ", the calibration is for " +
                  size_text(camera.width, camera.height) +
                  ": use the calibration of this mode, or ask the device for "
                  "the calibrated size",
              open);
}

// One pass over the pixels, into memory that is reused.
Expected<void> to_gray(const cv::Mat& image, GrayImage& out) {
  out.resize(image.cols, image.rows);
  cv::Mat gray(image.rows, image.cols, CV_8UC1, out.pixels.data());
  switch (image.type()) {
    case CV_8UC1:
      image.copyTo(gray);
      return {};
    case CV_8UC3:
      cv::cvtColor(image, gray, cv::COLOR_BGR2GRAY);
      return {};
    case CV_8UC4:
      cv::cvtColor(image, gray, cv::COLOR_BGRA2GRAY);
      return {};
    case CV_8UC2:
      cv::cvtColor(image, gray, cv::COLOR_YUV2GRAY_YUY2);
      return {};
    case CV_16UC1:
      image.convertTo(gray, CV_8UC1, 1.0 / 256);
      return {};
    default:
      break;
  }
  return fail(ErrorCode::kUnsupported,
              "pixel format " + cv::typeToString(image.type()) + " is not supported");
}

/// What a live and a filed camera have in common: grab, decode, convert.
class VideoReader final {
 public:
  VideoReader(cv::VideoCapture video, std::string name, const CameraModel& camera)
      : video_(std::move(video)), name_(std::move(name)), camera_(camera) {}

  bool grab() { return video_.grab(); }
  /// The image grabbed last; null when it cannot be decoded, which is said once.
  Expected<std::shared_ptr<const GrayImage>> image() {
    if (!video_.retrieve(decoded_) || decoded_.empty()) {
      if (++undecodable_ == 1)
        log::warning("capture", name_ + ": an image cannot be decoded; such images are left out");
      return nullptr;
    }
    if (const auto fits = check_size(decoded_, camera_, name_); !fits)
      return tl::unexpected(fits.error());
    std::shared_ptr<GrayImage> gray = pool_.acquire();
    if (const auto converted = to_gray(decoded_, *gray); !converted)
      return tl::unexpected(converted.error());
    return gray;
  }
  cv::VideoCapture& video() { return video_; }
  const std::string& name() const { return name_; }

 private:
  cv::VideoCapture video_;
  std::string name_;
  CameraModel camera_;
  cv::Mat decoded_;
  GrayImagePool pool_;
  std::uint64_t undecodable_{0};
};

/// A device or pipeline: images are stamped when they arrive.
class LiveCamera final : public SensorSource {
 public:
  LiveCamera(VideoReader reader, const CameraDeviceConfig& config, const Clock& clock)
      : reader_(std::move(reader)),
        before_arrival_(from_seconds(config.latency_s + config.exposure_s / 2) - config.time_shift),
        clock_(clock) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (!reader_.grab())
        return fail(ErrorCode::kClosed, "gives no more images; is it still plugged in?",
                    reader_.name());
      const Instant exposed_at = clock_.now() - before_arrival_;
      auto image = reader_.image();
      if (!image) return tl::unexpected(image.error());
      // Two buffered images may come within one tick of the clock; the older one has its place
      // already.
      if (!*image || (last_ && exposed_at <= *last_)) continue;
      last_ = exposed_at;
      return CameraFrame{0, exposed_at, std::move(*image)};
    }
    return std::nullopt;
  }

 private:
  VideoReader reader_;
  Duration before_arrival_;
  const Clock& clock_;
  std::optional<Instant> last_;
};

/// A video file: images are stamped by their place in it.
class FiledCamera final : public SensorSource {
 public:
  FiledCamera(VideoReader reader, const CameraDeviceConfig& config, const Clock& clock)
      : reader_(std::move(reader)), config_(config), clock_(clock) {
    const double rate_hz =
        config.rate_hz > 0 ? config.rate_hz : reader_.video().get(cv::CAP_PROP_FPS);
    constexpr double kUsual_hz = 30;
    period_ = from_seconds(1.0 / (rate_hz > 0.01 && rate_hz < 10'000 ? rate_hz : kUsual_hz));
  }

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (!reader_.grab()) {
        if (!config_.loop || !rewind()) return std::nullopt;
        continue;
      }
      const Duration in_video = pass_offset_ + place_of_frame();
      auto image = reader_.image();
      if (!image) return tl::unexpected(image.error());
      if (!*image) continue;
      some_in_pass_ = true;
      if (config_.paced && !started_at_) started_at_ = clock_.now() - in_video;
      const Instant due = started_at_.value_or(Instant{}) + in_video;
      if (config_.paced && !clock_.wait_until(due, stop)) return std::nullopt;
      return CameraFrame{0, due + config_.time_shift, std::move(*image)};
    }
    return std::nullopt;
  }

 private:
  // The time the file gives for the frame; counted where it gives none or goes backwards, so that
  // it always grows.
  Duration place_of_frame() {
    const Duration counted = last_place_ ? *last_place_ + period_ : Duration{0};
    const double given_ms = reader_.video().get(cv::CAP_PROP_POS_MSEC);
    const bool is_usable = config_.rate_hz <= 0 && std::isfinite(given_ms) && given_ms >= 0;
    Duration place = is_usable ? from_seconds(given_ms * 1e-3) : counted;
    constexpr Duration kLongestGap = std::chrono::minutes(1);
    if (last_place_ && (place <= *last_place_ || place > *last_place_ + kLongestGap))
      place = counted;
    last_place_ = place;
    return place;
  }

  bool rewind() {
    if (!std::exchange(some_in_pass_, false)) return false;  // it would spin for ever
    pass_offset_ += *last_place_ + period_;
    last_place_.reset();
    return reader_.video().open(config_.open, kFileBackend);
  }

  VideoReader reader_;
  CameraDeviceConfig config_;
  const Clock& clock_;
  Duration period_{};
  Duration pass_offset_{0};
  std::optional<Duration> last_place_;  ///< Of this pass.
  std::optional<Instant> started_at_;
  bool some_in_pass_{false};
};

Expected<cv::VideoCapture> open_video(const CameraDeviceConfig& config, Kind kind) {
  cv::VideoCapture video;
  std::error_code ignored;
  if (kind == Kind::kFile && !std::filesystem::is_regular_file(config.open, ignored)) {
    return fail(ErrorCode::kNotFound,
                "no such video file (a device is /dev/videoN or N, a GStreamer pipeline has a '!')",
                config.open);
  }
  if (kind == Kind::kDevice) {
    const bool by_number = is_number(config.open);
    if (by_number) {
      video.open(std::stoi(config.open), cv::CAP_V4L2);
    } else {
      video.open(config.open, cv::CAP_V4L2);
    }
  } else {
    video.open(config.open, kind == Kind::kPipeline ? cv::CAP_GSTREAMER : kFileBackend);
  }
  if (video.isOpened()) {
    // Pictures stay as the sensor read them out, as those of a JPEG do: a phone that was held
    // upright has the same calibration.
    if (kind == Kind::kFile) video.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
    return video;
  }
  const char* hint =
      kind == Kind::kDevice     ? "cannot be opened: is it there, free, and may this user read it?"
      : kind == Kind::kPipeline ? "is no GStreamer pipeline that starts: it must end in appsink "
                                  "(package gstreamer1.0-plugins-base)"
                                : "is no video that OpenCV can read";
  return fail(ErrorCode::kUnavailable, hint, config.open);
}

void ask_for_mode(const CameraDeviceConfig& config, cv::VideoCapture& video) {
  if (config.width > 0) video.set(cv::CAP_PROP_FRAME_WIDTH, config.width);
  if (config.height > 0) video.set(cv::CAP_PROP_FRAME_HEIGHT, config.height);
  if (config.rate_hz > 0) video.set(cv::CAP_PROP_FPS, config.rate_hz);
  video.set(cv::CAP_PROP_BUFFERSIZE, 1);  // an image that waited is an image that came late
}

Expected<void> check_mode(const CameraDeviceConfig& config, const CameraModel& camera,
                          const cv::VideoCapture& video) {
  const int width = static_cast<int>(video.get(cv::CAP_PROP_FRAME_WIDTH));
  const int height = static_cast<int>(video.get(cv::CAP_PROP_FRAME_HEIGHT));
  if (camera.width == 0) return {};
  if (width <= 0 || height <= 0) return {};  // not known before the first image
  if (width == camera.width && height == camera.height) return {};
  std::string what = "gives images of " + size_text(width, height);
  if (config.width > 0 || config.height > 0)
    what += " (asked for " + size_text(config.width, config.height) + ")";
  return fail(ErrorCode::kInvalid,
              what + ", the calibration is for " + size_text(camera.width, camera.height) +
                  ": use the calibration of this mode, or ask the device for the calibrated size",
              config.open);
}

}  // namespace

bool is_file(const CameraDeviceConfig& config) { return kind_of(config.open) == Kind::kFile; }

std::vector<ConfigError> CameraDeviceConfig::check(const std::string& prefix) const {
  Checker checker{prefix};
  checker.require(!open.empty(), "open", open, "must name a device, a file or a pipeline")
      .within("width", width, 0, 65535)
      .within("height", height, 0, 65535)
      .require((width == 0) == (height == 0), "height", height, "must be given together with width")
      .within("rate_hz", rate_hz, 0, 10'000)
      .within("exposure_s", exposure_s, 0, 1)
      .within("latency_s", latency_s, 0, 10);
  return checker.errors;
}

Expected<std::unique_ptr<SensorSource>> open_camera_device(const CameraDeviceConfig& config,
                                                           const CameraModel& camera,
                                                           const Clock& clock) {
  const Kind kind = kind_of(config.open);
  Expected<cv::VideoCapture> video = open_video(config, kind);
  if (!video) return tl::unexpected(video.error());
  if (kind == Kind::kDevice) ask_for_mode(config, *video);
  if (const auto fits = check_mode(config, camera, *video); !fits)
    return tl::unexpected(fits.error());
  VideoReader reader(std::move(*video), config.open, camera);
  if (kind == Kind::kFile) return std::make_unique<FiledCamera>(std::move(reader), config, clock);
  return std::make_unique<LiveCamera>(std::move(reader), config, clock);
}

std::vector<ConfigError> check_source(const CameraDeviceConfig& config,
                                      const SourceSurroundings& around,
                                      const std::string& body_prefix) {
  Checker rules{body_prefix, config.check(body_prefix + "source.")};
  rules
      .require(around.cameras.size() == 1, "cameras",
               std::to_string(around.cameras.size()) + " entries",
               "a camera source has exactly one camera")
      .require(!around.has_imu, "imu", "{…}", "a camera source has no IMU");
  return rules.errors;
}

}  // namespace fiducap
