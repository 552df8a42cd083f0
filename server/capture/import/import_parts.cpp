#include "capture/import/import_parts.hpp"

#include <utility>

#include "base/log.hpp"
#include "capture/camera_device.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {
namespace {

/// The images of one camera: image files, or another source, whose stamps are shifted.
struct CameraPart {
  std::vector<ListedImage> files;
  std::unique_ptr<SensorSource> source;  ///< Instead of files.
  Duration added{0};                     ///< To the stamps of `source`.
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

  Expected<std::optional<SensorSample>> from_files(const CameraPart& part) {
    const CameraMount& mount = mounts_[camera_];
    while (next_file_ < part.files.size()) {
      const ListedImage& listed = part.files[next_file_++];
      auto image = pool_.acquire();
      image->resize(mount.model.width, mount.model.height);
      const auto read = read_gray_file(listed.file, scratch_, *image);
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
  std::vector<std::uint8_t> scratch_;
  GrayImagePool pool_;
  bool warned_{false};
};

}  // namespace

OpenedSource PartsImport::open(const ImportChoice& choice,
                               const std::vector<CameraMount>& cameras) {
  std::vector<CameraPart> parts;
  for (std::size_t k = 0; k < choice.images.size(); ++k) {
    const Camera& camera = cameras_[choice.images[k]];
    CameraPart part{camera.files, nullptr, camera.begins};
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

void PartsImport::add_camera(FoundStream found, Camera camera) {
  streams_.push_back(std::move(found));
  cameras_.push_back(std::move(camera));
}

void PartsImport::add_imu(FoundStream found, std::vector<ImuSample> samples) {
  streams_.push_back(std::move(found));
  cameras_.emplace_back();
  imu_ = std::move(samples);
}

Expected<FoundStream> PartsImport::stream_of(std::string name,
                                             const std::vector<ListedImage>& files) {
  std::vector<std::uint8_t> scratch;
  GrayImage image;
  if (const auto read = read_gray_file_of_any_size(files.front().file, scratch, image); !read)
    return tl::unexpected(read.error());
  FoundStream found;
  found.name = std::move(name);
  found.type = "pictures";
  found.mount.model.width = image.width;
  found.mount.model.height = image.height;
  found.count = files.size();
  found.first_ns = files.front().ns;
  found.last_ns = files.back().ns;
  return found;
}

OpenedSource open_video_file(const std::string& path, const CameraModel& model,
                             const Clock& clock) {
  CameraDeviceConfig video;
  video.open = path;
  video.paced = false;
  return open_camera_device(video, model, clock);
}

}  // namespace fiducap
