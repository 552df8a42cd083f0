#include "capture/import/import_source.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <initializer_list>
#include <set>

#include "base/yaml_section.hpp"
#include "capture/import/import_parts.hpp"
#include "capture/import/imu_csv.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

/// The first file with one of these endings.
std::string file_in(const std::string& folder, std::initializer_list<const char*> endings) {
  std::set<std::string> found;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
    if (std::ranges::count(endings, entry.path().extension().string()) > 0)
      found.insert(entry.path().string());
  return found.empty() ? "" : *found.begin();
}

/// What to do with a folder of a video beside a table, as recorders on phones write it.
std::string video_in(const std::string& folder) {
  const std::string video = file_in(folder, {".mp4", ".avi", ".mkv", ".mov", ".MP4", ".MOV"});
  if (video.empty()) return "";
  const std::string table = file_in(folder, {".csv"});
  return ". Its video: fiducap import " + video + (table.empty() ? "" : " --imu " + table);
}

OpenedImport open_folder_import(const std::string& path, const ImportOptions& options,
                                const ImportProgress& progress) {
  if (is_asl_folder(path)) return open_asl_import(path, options);
  if (is_sensor_logger_folder(path)) return open_sensor_logger(path, options);
  auto log = open_log_import({path}, options, progress);
  if (log || log.error().code != ErrorCode::kNotFound) return log;
  return fail(
      ErrorCode::kNotFound,
      "is no known recording: expected a folder of EuRoC (mav0) or Kalibr (cam0, imu0.csv), "
      "of bags or rosbag2 (.bag, .db3, .mcap) or of Sensor Logger (Gyroscope.csv)" +
          video_in(path),
      path);
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

/// @param k  of the cameras of the file
/// @return number of the cameras of the file
Expected<std::size_t> apply_to_camera(const std::string& file, std::size_t k, FoundStream& camera) {
  const auto read = read_calibration(file, camera.mount);
  if (!read) return tl::unexpected(read.error());
  if (k >= read->size()) return read->size();
  const CalibratedCamera& found = (*read)[k];
  if (const auto fits = require_size(found.mount.model, camera, file); !fits)
    return tl::unexpected(fits.error());
  camera.mount = found.mount;
  camera.lens_known = true;
  if (found.place != CameraPlace::kUnknown) camera.place = found.place;
  return read->size();
}

/// By its first bytes.
bool is_text(const std::string& path) {
  const auto line = first_line(path);
  return line && std::ranges::none_of(
                     *line, [](char c) { return c >= 0 && c < ' ' && c != '\t' && c != '\r'; });
}

/// EuRoC's place of a camera.
Expected<void> take_place(const YamlSection& yaml, FoundStream& camera) {
  if (!yaml.has("T_BS")) return {};
  const auto X_BV = yaml.pose("T_BS");
  if (const auto sound = yaml.check(); !sound) return sound;
  camera.mount.X_BV = *X_BV;
  camera.place = CameraPlace::kOnBody;
  return {};
}

}  // namespace

OpenedImport open_import(const std::vector<std::string>& paths, const ImportOptions& options,
                         const ImportProgress& progress) {
  if (paths.size() > 1) {
    for (const std::string& path : paths)
      if (const std::string kind = log_kind(path); kind.empty() || kind == kZipArchive)
        return fail(ErrorCode::kInvalid,
                    "cannot be joined with others: several sources are one recording only when "
                    "each is a bag of ROS 1, MCAP or rosbag2",
                    path);
    return open_log_import(paths, options, progress);
  }
  const std::string& path = paths.front();
  const std::string kind = log_kind(path);
  const bool is_archive = kind == kZipArchive;
  const bool is_log = !kind.empty() && !is_archive;
  if (!options.imu_csv.empty() && (is_folder(path) || is_archive || is_log))
    return fail(ErrorCode::kInvalid, "is no video: only a video is combined with a table of an IMU",
                path);
  if (is_folder(path)) return open_folder_import(path, options, progress);
  if (!is_file(path)) return fail(ErrorCode::kNotFound, "no such file or folder", path);
  if (is_archive) return open_sensor_logger(path, options);
  if (is_log) return open_log_import(paths, options, progress);
  std::string table_fault;
  if (is_text(path)) {
    auto table = open_imu_import(path, options);
    if (table) return table;
    table_fault = "; as a table: " + table.error().what;
  }
  auto video = open_video_import(path, options);
  if (video || video.error().code == ErrorCode::kNotFound || !options.imu_csv.empty()) return video;
  return fail(ErrorCode::kUnsupported,
              "is no known recording: expected a bag of ROS 1, rosbag2 (.db3 or a folder), "
              "MCAP (several are one recording), a video, a ZIP archive of Sensor Logger, a folder "
              "of EuRoC, or a table of an "
              "IMU (.csv)" +
                  table_fault,
              path);
}

Expected<void> apply_calibrations(const std::vector<std::string>& files,
                                  std::vector<FoundStream>& cameras,
                                  std::optional<ImuNoise>& noise) {
  constexpr std::array kNoiseKeys{"imu0", "gyroscope_noise_density", "Gyr", "gyr_n"};
  std::size_t next = 0;
  for (const std::string& file : files) {
    const auto yaml = YamlSection::load(file);
    if (yaml && std::ranges::any_of(kNoiseKeys, [&](const char* key) { return yaml->has(key); })) {
      const auto read = read_imu_noise(file);
      if (!read) return tl::unexpected(read.error());
      noise = *read;
      if (!yaml->has("projection_parameters")) continue;  // VINS has both
    }
    if (next >= cameras.size())
      return fail(
          ErrorCode::kInvalid,
          "is one calibration more than there are cameras (" + std::to_string(cameras.size()) + ")",
          file);
    const std::size_t first = next;
    for (std::size_t of_file = 1; next < std::min(first + of_file, cameras.size()); ++next) {
      const auto count = apply_to_camera(file, next - first, cameras[next]);
      if (!count) return tl::unexpected(count.error());
      of_file = *count;
    }
    if (!yaml) continue;
    if (const auto done = take_place(*yaml, cameras[first]); !done) return done;
  }
  return {};
}

}  // namespace fiducap
