#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/log.hpp"
#include "calibration/intrinsics/intrinsics_calibration.hpp"
#include "calibration/intrinsics/view_collector.hpp"
#include "capture/camera_device.hpp"
#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_layout.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/system.hpp"
#include "detection/no_tag.hpp"
#include "detection/tag_family.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

const SystemClock kClock;  // outlives the sources; nothing is paced

/// One image to search for targets, or the corners that another detector found in it.
struct CalibrationImage {
  std::string name;
  std::shared_ptr<const GrayImage> image;  ///< Null when there are corners only.
  CornerFrame corners;
  int width{};
  int height{};
};

bool is_picture(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::ranges::transform(ending, ending.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array<const char*, 8> kEndings{".png", ".jpg",  ".jpeg", ".bmp",
                                                ".pgm", ".tiff", ".tif",  ".webp"};
  return std::ranges::find(kEndings, ending) != kEndings.end();
}

/// Images of one camera, calibrated or not: a folder of pictures, a video file, or a recording.
class CalibrationImages final {
 public:
  /// @param camera  which camera of a recording
  /// @return Error with what was expected
  [[nodiscard]] static Expected<CalibrationImages> open(const std::string& path,
                                                        std::size_t camera) {
    if (!log_kind(path).empty()) return tl::unexpected(RecordingLayout::find(path).error());
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

  /// @return nullopt at the end. Unreadable pictures are skipped, the first one is logged.
  [[nodiscard]] Expected<std::optional<CalibrationImage>> next() {
    if (source_) return next_sample();
    return next_file();
  }

  /// Number of images; 0: unknown.
  [[nodiscard]] std::size_t total() const { return files_.size(); }
  /// nullopt for pictures and videos.
  [[nodiscard]] const std::optional<RecordingInfo>& recording() const { return recording_; }

 private:
  [[nodiscard]] static Expected<CalibrationImages> open_recorded(const std::string& path,
                                                                 std::size_t camera) {
    auto info = read_recording_info(path);
    if (!info) return tl::unexpected(info.error());
    if (camera >= info->cameras.size())
      return fail(
          ErrorCode::kNotFound,
          "has " + std::to_string(info->cameras.size()) + " cameras, --camera counts from 0", path);
    auto source = open_recording(*info, {}, kClock);
    if (!source) return tl::unexpected(source.error());
    CalibrationImages images;
    images.source_ = std::move(*source);
    images.recording_ = std::move(*info);
    images.camera_ = camera;
    return images;
  }

  [[nodiscard]] static Expected<CalibrationImages> open_folder(const std::string& path) {
    CalibrationImages images;
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(path, error))
      if (is_file(entry.path()) && is_picture(entry.path())) images.files_.push_back(entry.path());
    if (error) return fail(ErrorCode::kUnavailable, "cannot be read: " + error.message(), path);
    if (images.files_.empty())
      return fail(
          ErrorCode::kNotFound,
          "holds neither pictures (.png, .jpg, .bmp, .pgm, .tiff, .webp) nor a recording (mav0)",
          path);
    std::ranges::sort(images.files_);
    return images;
  }

  [[nodiscard]] std::optional<CalibrationImage> next_file() {
    while (next_file_ < files_.size()) {
      const std::filesystem::path& file = files_[next_file_++];
      auto image = std::make_shared<GrayImage>();
      const auto read = decoder_.read_file(file, {}, *image);
      if (read)
        return CalibrationImage{file.filename().string(), image, {}, image->width, image->height};
      if (left_out_++ == 0)
        log::warning("calibrate", read.error().text() + "; such pictures are left out");
    }
    return std::nullopt;
  }

  [[nodiscard]] Expected<std::optional<CalibrationImage>> next_sample() {
    for (;;) {
      auto sample = source_->next({});
      if (!sample) return tl::unexpected(sample.error());
      if (!*sample) return std::nullopt;
      const auto* frame = std::get_if<CameraFrame>(&**sample);
      const auto* corners = std::get_if<CornerFrame>(&**sample);
      const int camera = static_cast<int>(camera_);
      const bool is_wanted = frame != nullptr ? frame->camera == camera
                                              : corners != nullptr && corners->camera == camera;
      if (!is_wanted) continue;
      const std::string name = "image " + std::to_string(++seen_);
      if (frame != nullptr)
        return CalibrationImage{name, frame->image, {}, frame->image->width, frame->image->height};
      const CameraModel& model = recording_->cameras[camera_].model;
      return CalibrationImage{name, nullptr, *corners, model.width, model.height};
    }
  }

  std::vector<std::filesystem::path> files_;
  std::size_t next_file_{0};
  GrayDecoder decoder_;
  std::unique_ptr<SensorSource> source_;
  std::optional<RecordingInfo> recording_;
  std::size_t camera_{0};
  std::size_t seen_{0};
  std::size_t left_out_{0};
};

constexpr double kUsualTag_m = 0.16;

Expected<Checkerboard> read_checkerboard(const CalibrateCameraArguments& arguments) {
  const auto size = pair_from(arguments.checkerboard);
  const auto fits = [](int n) { return n >= 3 && n <= 100; };
  if (size && fits(size->first) && fits(size->second))
    return Checkerboard{size->first, size->second, arguments.square_mm / 1000};
  return fail(ErrorCode::kInvalid,
              "must be COLUMNSxROWS of inner corners (one less than squares), 3 to 100 each, e.g. "
              "9x6; is '" +
                  arguments.checkerboard + "'",
              "--checkerboard");
}

Expected<CalibrationTargets> choose_targets(const CalibrateCameraArguments& arguments,
                                            const CalibrationImages& images) {
  CalibrationTargets targets;
  if (!arguments.checkerboard.empty()) {
    auto board = read_checkerboard(arguments);
    if (!board) return tl::unexpected(board.error());
    targets.checkerboard = *board;
    return targets;
  }
  targets.tags.size_m = kUsualTag_m;
  if (const auto& recording = images.recording()) targets.tags = tags_of(*recording);
  if (arguments.tag_mm > 0) {
    targets.tags.size_m = arguments.tag_mm / 1000;
    targets.tags.sizes_m.clear();
  }
  if (!arguments.board.empty()) {
    auto board = read_board(arguments.board);
    if (!board) return tl::unexpected(board.error());
    targets.checkerboard = board->checkerboard;
    if (board->is_board()) {
      if (!board->checkerboard) targets.board = std::move(*board);
    } else {
      targets.tags.size_m = board->tag_m;
    }
  }
  if (!arguments.family.empty()) targets.tags.family = listed_tag_family(arguments.family);
  if (const auto faults = targets.tags.check(); !faults.empty())
    return fail(ErrorCode::kInvalid, faults.front().text());
  return targets;
}

Expected<CollectedViews> collect_views(
    CalibrationImages& images, const CalibrationTargets& targets,
    const std::function<void(std::size_t, std::size_t)>& progress) {
  ViewCollector collector(targets);
  CollectedViews out;
  CalibrationData& data = out.data;
  for (;;) {
    const auto image = images.next();
    if (!image) return tl::unexpected(image.error());
    if (!*image) break;
    if (out.images++ == 0) {
      data.width = (*image)->width;
      data.height = (*image)->height;
    } else if ((*image)->width != data.width || (*image)->height != data.height) {
      return fail(ErrorCode::kInvalid,
                  (*image)->name + " is " + size_text((*image)->width, (*image)->height) +
                      ", the images before are " + size_text(data.width, data.height) +
                      ": a calibration is for one size");
    }
    if ((*image)->image) out.few.note((*image)->image);
    auto view = (*image)->image ? collector.look((*image)->name, (*image)->image)
                                : collector.look((*image)->name, (*image)->corners);
    if (view) data.views.push_back(std::move(*view));
    progress(out.images, data.views.size());
  }
  data.targets = collector.targets();
  return out;
}

std::string not_found_text(const CalibrationTargets& targets, const CollectedViews& seen) {
  const std::string images = " in " + std::to_string(seen.images) + " images";
  if (const auto& board = targets.checkerboard)
    return "no whole checkerboard of " + std::to_string(board->columns) + "x" +
           std::to_string(board->rows) + " inner corners (count them; all must be in view)" +
           images;
  const std::string why = why_no_tag(seen.few.images(), targets.tags, {});
  return (targets.board ? "no tag of the " + targets.board->board.name : std::string("no tag")) +
         " of 20 px or more" + images + (why.empty() ? "" : ": " + why);
}

}  // namespace

Expected<CollectedViews> views_in_images(const CalibrateCameraArguments& arguments,
                                         ProgressLine& line) {
  auto images =
      CalibrationImages::open(arguments.input, static_cast<std::size_t>(arguments.camera));
  if (!images) return tl::unexpected(images.error());
  const auto targets = choose_targets(arguments, *images);
  if (!targets) return tl::unexpected(targets.error());
  const std::string of =
      images->total() > 0 ? " of " + std::to_string(images->total()) : std::string();
  auto seen = collect_views(*images, *targets, [&](std::size_t looked, std::size_t found) {
    line.show("looking for targets: " + std::to_string(looked) + of + " images, " +
              std::to_string(found) + " with");
  });
  if (!seen) return seen;
  // Squares that are tags of the given family by chance are too few for a calibration.
  const auto views = static_cast<std::ptrdiff_t>(seen->data.views.size());
  const bool are_others = views < kFewestViews && !targets->board && !targets->checkerboard &&
                          !other_family_in(seen->few.images(), targets->tags).empty();
  if (views > 0 && !are_others) return seen;
  return fail(ErrorCode::kNotFound, not_found_text(*targets, *seen), arguments.input);
}

}  // namespace fiducap
