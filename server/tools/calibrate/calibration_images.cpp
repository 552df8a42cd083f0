#include "tools/calibrate/calibration_images.hpp"

#include <algorithm>
#include <array>
#include <cctype>

#include "base/log.hpp"
#include "capture/camera_device.hpp"
#include "capture/recording/gray_file.hpp"
#include "capture/recording/recording_layout.hpp"
#include "daemon/system_clock.hpp"

namespace fiducap {
namespace {

const SystemClock kClock;  // outlives the sources; nothing is paced

bool is_picture(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array<const char*, 8> kEndings{".png", ".jpg",  ".jpeg", ".bmp",
                                                ".pgm", ".tiff", ".tif",  ".webp"};
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

}  // namespace

Expected<CalibrationImages> CalibrationImages::open(const std::string& path, std::size_t camera) {
  if (is_folder(path))
    return RecordingLayout::find(path) ? open_recorded(path, camera) : open_folder(path);
  CameraDeviceConfig video;
  video.open = path;
  video.paced = false;
  if (!is_file(path))
    return fail(ErrorCode::kNotFound,
                "no such folder or file: expected a folder of pictures, a video or a recording",
                path);
  auto source = open_camera_device(video, CameraModel{}, kClock);
  if (!source) return tl::unexpected(source.error());
  CalibrationImages images;
  images.source_ = std::move(*source);
  return images;
}

Expected<CalibrationImages> CalibrationImages::open_recorded(const std::string& path,
                                                             std::size_t camera) {
  auto info = read_recording_info(path);
  if (!info) return tl::unexpected(info.error());
  if (camera >= info->cameras.size())
    return fail(ErrorCode::kNotFound,
                "has " + std::to_string(info->cameras.size()) + " cameras, --camera counts from 0",
                path);
  auto source = open_recording(*info, {}, kClock);
  if (!source) return tl::unexpected(source.error());
  CalibrationImages images;
  images.source_ = std::move(*source);
  images.recording_ = std::move(*info);
  images.camera_ = camera;
  return images;
}

Expected<CalibrationImages> CalibrationImages::open_folder(const std::string& path) {
  CalibrationImages images;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(path, error))
    if (is_file(entry.path()) && is_picture(entry.path())) images.files_.push_back(entry.path());
  if (error) return fail(ErrorCode::kUnavailable, "cannot be read: " + error.message(), path);
  if (images.files_.empty())
    return fail(ErrorCode::kNotFound,
                "holds neither pictures (.png, .jpg, .bmp, .pgm, .tiff, .webp) nor a recording "
                "(mav0)",
                path);
  std::sort(images.files_.begin(), images.files_.end());
  return images;
}

Expected<std::optional<CalibrationImage>> CalibrationImages::next() {
  if (source_) return next_sample();
  return next_file();
}

std::optional<CalibrationImage> CalibrationImages::next_file() {
  while (next_file_ < files_.size()) {
    const std::filesystem::path& file = files_[next_file_++];
    auto image = std::make_shared<GrayImage>();
    const auto read = read_gray_file_of_any_size(file, scratch_, *image);
    if (read)
      return CalibrationImage{file.filename().string(), image, {}, image->width, image->height};
    if (left_out_++ == 0)
      log::warning("calibrate", read.error().text() + "; such pictures are left out");
  }
  return std::nullopt;
}

Expected<std::optional<CalibrationImage>> CalibrationImages::next_sample() {
  for (;;) {
    auto sample = source_->next({});
    if (!sample) return tl::unexpected(sample.error());
    if (!*sample) return std::nullopt;
    const int camera = static_cast<int>(camera_);
    if (const auto* frame = std::get_if<CameraFrame>(&**sample); frame && frame->camera == camera)
      return CalibrationImage{"image " + std::to_string(++seen_),
                              frame->image,
                              {},
                              frame->image->width,
                              frame->image->height};
    if (const auto* corners = std::get_if<CornerFrame>(&**sample);
        corners && corners->camera == camera) {
      const CameraModel& model = recording_->cameras[camera_].model;
      return CalibrationImage{"image " + std::to_string(++seen_), nullptr, *corners, model.width,
                              model.height};
    }
  }
}

}  // namespace fiducap
