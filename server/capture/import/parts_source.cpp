#include "capture/import/parts_source.hpp"

#include <utility>

#include "base/log.hpp"
#include "capture/camera_device.hpp"
#include "capture/recording/gray_file.hpp"

namespace fiducap {
namespace {

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
      if (!std::exchange(complained_, true))
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
  bool complained_{false};
};

}  // namespace

std::unique_ptr<SensorSource> make_parts_source(std::vector<ImuSample> imu,
                                                std::vector<CameraPart> cameras,
                                                const std::vector<CameraMount>& mounts) {
  return std::make_unique<PartsSource>(std::move(imu), std::move(cameras), mounts);
}

Expected<std::unique_ptr<SensorSource>> open_video_file(const std::string& path,
                                                        const CameraModel& model,
                                                        const Clock& clock) {
  CameraDeviceConfig video;
  video.open = path;
  video.paced = false;
  return open_camera_device(video, model, clock);
}

Expected<CameraModel> size_of_first(const std::vector<ListedImage>& images) {
  CameraModel size;
  if (images.empty()) return size;
  std::vector<std::uint8_t> scratch;
  GrayImage image;
  const auto read = read_gray_file_of_any_size(images.front().file, scratch, image);
  if (!read) return tl::unexpected(read.error());
  size.width = image.width;
  size.height = image.height;
  return size;
}

}  // namespace fiducap
