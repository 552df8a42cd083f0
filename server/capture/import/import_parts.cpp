#include "capture/import/import_parts.hpp"

#include <filesystem>
#include <utility>

#include "base/log.hpp"
#include "base/text.hpp"
#include "capture/camera_device.hpp"
#include "capture/gray_image.hpp"
#include "capture/import/imu_csv.hpp"

namespace fiducap {
namespace {

/// The images of one camera: image files, or another source, whose stamps are shifted.
struct CameraPart {
  std::vector<ListedImage> files;
  std::unique_ptr<SensorSource> source;  ///< Instead of files.
  Duration added{0};                     ///< To the stamps of `source`.
  GrayDecoder decoder{};                 ///< Of files.
};

class PartsSource final : public SensorSource {
 public:
  PartsSource(std::vector<ImuSample> imu, std::vector<CameraPart> cameras,
              std::vector<CameraMount> mounts)
      : imu_(std::move(imu)), cameras_(std::move(cameras)), mounts_(std::move(mounts)) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    if (next_imu_ < imu_.size()) return imu_[next_imu_++];
    for (; camera_ < cameras_.size() && !stop.stop_requested(); ++camera_, next_file_ = 0) {
      CameraPart& part = cameras_[camera_];
      auto image = part.source ? from_source(part, stop) : from_files(part);
      if (!image || *image) return image;
    }
    return std::nullopt;
  }

 private:
  Expected<std::optional<SensorSample>> from_source(CameraPart& part, std::stop_token stop) const {
    auto sample = part.source->next(std::move(stop));
    if (!sample || !*sample) return sample;
    auto* frame = std::get_if<CameraFrame>(&**sample);
    if (frame == nullptr) return std::nullopt;
    frame->camera = static_cast<int>(camera_);
    frame->exposed_at += part.added + mounts_[camera_].time_shift;
    return sample;
  }

  Expected<std::optional<SensorSample>> from_files(CameraPart& part) {
    const CameraMount& mount = mounts_[camera_];
    const PixelSize size{mount.model.width, mount.model.height};
    while (next_file_ < part.files.size()) {
      const ListedImage& listed = part.files[next_file_++];
      auto image = pool_.acquire();
      const auto read = part.decoder.read_file(listed.file, size, *image);
      if (read)
        return CameraFrame{static_cast<int>(camera_), instant_from_ns(listed.ns) + mount.time_shift,
                           std::move(image)};
      if (!std::exchange(warned_, true))
        log::warning("import", read.error().text() + "; such images are left out");
    }
    return std::nullopt;
  }

  std::vector<ImuSample> imu_;
  std::vector<CameraPart> cameras_;
  std::vector<CameraMount> mounts_;
  std::size_t next_imu_{0};
  std::size_t camera_{0};
  std::size_t next_file_{0};
  GrayImagePool pool_;
  bool warned_{false};
};

/// Not paced; images are stamped by their time in it. @param model  width 0: any size
OpenedSource open_video_file(const std::string& path, const CameraModel& model,
                             const Clock& clock) {
  CameraDeviceConfig video;
  video.open = path;
  video.paced = false;
  return open_camera_device(video, model, clock);
}

// Stamps of a recording stay positive with any offset.
constexpr Duration kVideoBegins = std::chrono::hours(1);
constexpr Duration kSameZero = std::chrono::minutes(1);

class VideoImport final : public PartsImport {
 public:
  explicit VideoImport(const Clock* clock) : PartsImport(clock) {}

  /// A table without a video.
  Expected<void> look_at_imu(const std::string& path, const ImportOptions& options) {
    auto table = read_imu_csv(path, options);
    if (!table) return tl::unexpected(table.error());
    remarks_ = std::move(table->remarks);
    const Instant first = table->samples.front().sampled_at;
    const Duration moved = first.time_since_epoch() > Duration{0} ? Duration{0} : kVideoBegins;
    for (ImuSample& sample : table->samples) sample.sampled_at += moved + options.imu_offset;
    table->found.first_ns = to_ns(table->samples.front().sampled_at);
    table->found.last_ns = to_ns(table->samples.back().sampled_at);
    add_imu(std::move(table->found), std::move(table->samples));
    return {};
  }

  Expected<void> look(const std::string& path, FoundStream video, const ImportOptions& options) {
    if (options.imu_csv.empty()) {
      add_camera(std::move(video), {{}, path, kVideoBegins});
      return {};
    }
    auto table = read_imu_csv(options.imu_csv, options);
    if (!table) return tl::unexpected(table.error());
    remarks_ = std::move(table->remarks);
    const Duration first = table->samples.front().sampled_at.time_since_epoch();
    const bool same_zero = std::chrono::abs(first) <= kSameZero;
    // Absolute stamps are kept; the video is shifted.
    const bool keeps = first > kVideoBegins;
    const Duration moved = keeps ? Duration{0} : same_zero ? kVideoBegins : kVideoBegins - first;
    add_camera(std::move(video), {{}, path, keeps ? first : kVideoBegins});
    for (ImuSample& sample : table->samples) sample.sampled_at += moved + options.imu_offset;
    remarks_.push_back(
        std::string(same_zero ? "the table's time counts from the video's first image"
                              : "the table's first reading is put at the video's first image") +
        (options.imu_offset == Duration{0}
             ? ": otherwise set --imu-offset"
             : ", shifted by " + fixed(to_seconds(options.imu_offset), 4) + " s"));
    table->found.first_ns = to_ns(table->samples.front().sampled_at);
    table->found.last_ns = to_ns(table->samples.back().sampled_at);
    add_imu(std::move(table->found), std::move(table->samples));
    return {};
  }
};

}  // namespace

OpenedSource PartsImport::open(const ImportChoice& choice,
                               const std::vector<CameraMount>& cameras) {
  std::vector<CameraPart> parts;
  for (std::size_t k = 0; k < choice.images.size(); ++k) {
    const Camera& camera = cameras_[choice.images[k]];
    CameraPart part{camera.files, nullptr, camera.begins,
                    GrayDecoder(streams_[choice.images[k]].used_bits)};
    if (!camera.video.empty()) {
      auto video = open_video_file(camera.video, cameras[k].model, *clock_);
      if (!video) return tl::unexpected(video.error());
      part.source = std::move(*video);
    }
    parts.push_back(std::move(part));
  }
  return std::make_unique<PartsSource>(choice.imu ? imu_ : std::vector<ImuSample>{},
                                       std::move(parts), cameras);
}

Expected<FoundStream> PartsImport::stream_of(std::string name,
                                             const std::vector<ListedImage>& files) {
  constexpr std::size_t kLookedAt = 16;  // of 16 bits, for the bits that they use
  GrayDecoder decoder;
  GrayImage image;
  if (const auto read = decoder.read_file(files.front().file, {}, image); !read)
    return tl::unexpected(read.error());
  const PixelSize size{image.width, image.height};
  const std::size_t step = files.size() / kLookedAt + 1;
  for (std::size_t i = step; i < files.size() && decoder.saw_16_bits(); i += step)
    if (!decoder.read_file(files[i].file, size, image)) break;
  FoundStream found;
  found.name = std::move(name);
  found.type = "pictures";
  found.mount.model.width = size.width;
  found.mount.model.height = size.height;
  found.used_bits = decoder.used_bits();
  found.count = files.size();
  found.first_ns = files.front().ns;
  found.last_ns = files.back().ns;
  return found;
}

Expected<FoundStream> look_at_video(const std::string& path, const Clock& clock) {
  auto video = open_video_file(path, {}, clock);
  if (!video) return tl::unexpected(video.error());
  const auto first = (*video)->next({});
  if (!first) return tl::unexpected(first.error());
  if (!*first) return fail(ErrorCode::kInvalid, "has no decodable image", path);
  const auto& image = *std::get<CameraFrame>(**first).image;
  FoundStream found;
  found.name = std::filesystem::path(path).filename().string();
  found.type = "video";
  found.mount.model.width = image.width;
  found.mount.model.height = image.height;
  found.lens_fault = "a video has no lens data";
  if (const auto second = (*video)->next({}); second && *second) {
    const Duration step = time_of(**second) - time_of(**first);
    if (step > Duration{0}) found.mount.rate_hz = 1 / to_seconds(step);
  }
  return found;
}

OpenedImport open_imu_import(const std::string& path, const ImportOptions& options) {
  auto source = std::make_unique<VideoImport>(options.clock);
  return source->look_at_imu(path, options).map([&] { return std::move(source); });
}

OpenedImport open_video_import(const std::string& path, const ImportOptions& options) {
  FIDUCAP_ASSERT(options.clock != nullptr);
  auto video = look_at_video(path, *options.clock);
  if (!video) return tl::unexpected(video.error());
  auto source = std::make_unique<VideoImport>(options.clock);
  return source->look(path, std::move(*video), options).map([&] { return std::move(source); });
}

}  // namespace fiducap
