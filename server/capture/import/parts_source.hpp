#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// A picture file and when it was taken.
struct ListedImage {
  std::int64_t ns{};
  std::string file;
};

/// The images of one camera: picture files, or another source, whose stamps are moved.
struct CameraPart {
  std::vector<ListedImage> files;
  std::unique_ptr<SensorSource> source;  ///< Instead of files.
  Duration added{0};                     ///< To the stamps of `source`.
};

/// Readings and images that come from different files, as one source: first the IMU, then one
/// camera after the other. A picture that cannot be read, or has another size, is left out and said
/// once.
[[nodiscard]] std::unique_ptr<SensorSource> make_parts_source(
    std::vector<ImuSample> imu, std::vector<CameraPart> cameras,
    const std::vector<CameraMount>& mounts);

/// A video file, as fast as it is read; its images are stamped by their place in it.
/// @param model  width 0: any size
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_video_file(const std::string& path,
                                                                      const CameraModel& model,
                                                                      const Clock& clock);

/// Size and first fault of a list of pictures, by the first of them.
[[nodiscard]] Expected<CameraModel> size_of_first(const std::vector<ListedImage>& images);

}  // namespace fiducap
