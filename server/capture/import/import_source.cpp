#include "capture/import/import_source.hpp"

#include <array>
#include <fstream>

#include "capture/import/asl_folder.hpp"
#include "capture/import/log_import.hpp"
#include "capture/import/sensor_logger.hpp"
#include "capture/import/video_import.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

Expected<std::unique_ptr<ImportSource>> open_folder_import(const std::string& path,
                                                           const ImportOptions& options,
                                                           const ImportProgress& progress) {
  if (RecordingLayout::find(path)) return open_asl_import(path, options);
  if (is_sensor_logger_folder(path)) return open_sensor_logger(path, options);
  auto log = open_log_import(path, options, progress);
  if (log || log.error().code != ErrorCode::kNotFound) return log;
  return fail(ErrorCode::kNotFound,
              "is no recording that is known: expected a folder of EuRoC (mav0), of rosbag2 "
              "(metadata.yaml, .db3, .mcap) or of Sensor Logger (Gyroscope.csv)",
              path);
}

std::string first_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 16> head{};
  file.read(head.data(), head.size());
  return {head.data(), static_cast<std::size_t>(file.gcount())};
}

}  // namespace

std::string FoundStream::text() const {
  std::string all = name + " (" + type;
  if (mount.model.width > 0)
    all += ", " + std::to_string(mount.model.width) + " x " + std::to_string(mount.model.height);
  if (!encoding.empty()) all += ", " + encoding;
  return all + ")";
}

double FoundStream::rate_hz() const {
  if (count < 2 || last_ns <= first_ns) return 0;
  return static_cast<double>(count - 1) * 1e9 / static_cast<double>(last_ns - first_ns);
}

Expected<std::unique_ptr<ImportSource>> open_import(const std::string& path,
                                                    const ImportOptions& options,
                                                    const ImportProgress& progress) {
  const std::string head = is_file(path) ? first_bytes(path) : "";
  const bool is_archive = head.starts_with("PK\x03\x04");
  const bool is_log = head.starts_with("#ROSBAG") || head.starts_with("\x89MCAP") ||
                      head.starts_with("SQLite format 3");
  if (!options.imu_csv.empty() && (is_folder(path) || is_archive || is_log))
    return fail(ErrorCode::kInvalid, "is no video: only a video takes its IMU from a table", path);
  if (is_folder(path)) return open_folder_import(path, options, progress);
  if (!is_file(path)) return fail(ErrorCode::kNotFound, "no such file or folder", path);
  if (is_archive) return open_sensor_logger(path, options);
  if (is_log) return open_log_import(path, options, progress);
  auto video = open_video_import(path, options);
  if (video || video.error().code == ErrorCode::kNotFound || !options.imu_csv.empty()) return video;
  return fail(ErrorCode::kUnsupported,
              "is no recording that is known: expected a bag of ROS 1, rosbag2 (.db3 or a folder), "
              "MCAP, a video, a ZIP archive of Sensor Logger, or a folder of EuRoC",
              path);
}

}  // namespace fiducap
