#include "capture/import/import_source.hpp"

#include <algorithm>
#include <array>
#include <fstream>

#include "base/yaml_section.hpp"
#include "capture/import/import_parts.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

OpenedImport open_folder_import(const std::string& path, const ImportOptions& options,
                                const ImportProgress& progress) {
  if (RecordingLayout::find(path)) return open_asl_import(path, options);
  if (is_sensor_logger_folder(path)) return open_sensor_logger(path, options);
  auto log = open_log_import(path, options, progress);
  if (log || log.error().code != ErrorCode::kNotFound) return log;
  return fail(ErrorCode::kNotFound,
              "is no known recording: expected a folder of EuRoC (mav0), of rosbag2 "
              "(metadata.yaml, .db3, .mcap) or of Sensor Logger (Gyroscope.csv)",
              path);
}

std::string first_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 16> head{};
  file.read(head.data(), head.size());
  return {head.data(), static_cast<std::size_t>(file.gcount())};
}

Expected<void> require_size(const CameraModel& model, const FoundStream& camera,
                            const std::string& file) {
  const CameraModel& images = camera.mount.model;
  if (images.width == 0 || (images.width == model.width && images.height == model.height))
    return {};
  return fail(ErrorCode::kInvalid,
              "is for images of " + size_text(model.width, model.height) + ", those of " +
                  camera.name + " are " + size_text(images.width, images.height),
              file);
}

Expected<void> apply_camchain(const std::string& file, std::vector<FoundStream>& cameras) {
  const auto mounts = read_kalibr_camchain(file);
  if (!mounts) return tl::unexpected(mounts.error());
  for (std::size_t k = 0; k < std::min(mounts->size(), cameras.size()); ++k) {
    FoundStream& camera = cameras[k];
    const CameraMount& mount = (*mounts)[k];
    if (const auto fits = require_size(mount.model, camera, file); !fits) return fits;
    camera.mount.model = mount.model;
    camera.mount.X_BV = mount.X_BV;
    camera.mount.time_shift = mount.time_shift;
    camera.lens_known = camera.place_known = true;
  }
  return {};
}

Expected<void> apply_to_camera(const std::string& file, FoundStream& camera) {
  const auto mount = read_camera_calibration(file, camera.mount);
  if (!mount) return tl::unexpected(mount.error());
  if (const auto fits = require_size(mount->model, camera, file); !fits) return fits;
  camera.mount = *mount;
  camera.lens_known = true;
  const auto yaml = YamlSection::load(file);
  if (!yaml || !yaml->has("T_BS")) return {};
  const auto X_BV = yaml->pose("T_BS");
  if (const auto sound = yaml->check(); !sound) return sound;
  camera.mount.X_BV = *X_BV;
  camera.place_known = true;
  return {};
}

}  // namespace

OpenedImport open_import(const std::string& path, const ImportOptions& options,
                         const ImportProgress& progress) {
  const std::string head = is_file(path) ? first_bytes(path) : "";
  const bool is_archive = head.starts_with("PK\x03\x04");
  const bool is_log = head.starts_with("#ROSBAG") || head.starts_with("\x89MCAP") ||
                      head.starts_with("SQLite format 3");
  if (!options.imu_csv.empty() && (is_folder(path) || is_archive || is_log))
    return fail(ErrorCode::kInvalid, "is no video: only a video is combined with a table of an IMU",
                path);
  if (is_folder(path)) return open_folder_import(path, options, progress);
  if (!is_file(path)) return fail(ErrorCode::kNotFound, "no such file or folder", path);
  if (is_archive) return open_sensor_logger(path, options);
  if (is_log) return open_log_import(path, options, progress);
  auto video = open_video_import(path, options);
  if (video || video.error().code == ErrorCode::kNotFound || !options.imu_csv.empty()) return video;
  return fail(ErrorCode::kUnsupported,
              "is no known recording: expected a bag of ROS 1, rosbag2 (.db3 or a folder), "
              "MCAP, a video, a ZIP archive of Sensor Logger, or a folder of EuRoC",
              path);
}

Expected<void> apply_calibrations(const std::vector<std::string>& files,
                                  std::vector<FoundStream>& cameras,
                                  std::optional<ImuNoise>& noise) {
  std::size_t next = 0;
  for (const std::string& file : files) {
    const auto yaml = YamlSection::load(file);
    if (!yaml) return tl::unexpected(yaml.error());
    if (yaml->has("cam0")) {
      if (const auto done = apply_camchain(file, cameras); !done) return done;
    } else if (yaml->has("imu0") || yaml->has("gyroscope_noise_density")) {
      const auto read = read_kalibr_imu(file);
      if (!read) return tl::unexpected(read.error());
      noise = *read;
    } else if (next < cameras.size()) {
      if (const auto done = apply_to_camera(file, cameras[next]); !done) return done;
      ++next;
    } else {
      return fail(
          ErrorCode::kInvalid,
          "is one calibration more than there are cameras (" + std::to_string(cameras.size()) + ")",
          file);
    }
  }
  return {};
}

}  // namespace fiducap
