#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "capture/import/import_source.hpp"
#include "capture/import/message_log.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/sensor_source.hpp"

/// The kinds of imports, and their common parts.
namespace fiducap {

/// Messages of ROS from bags, rosbag2 or MCAP; several are one recording.
[[nodiscard]] OpenedImport open_log_import(const std::vector<std::string>& paths,
                                           const ImportOptions& options,
                                           const ImportProgress& progress);

/// A folder of EuRoC (with or without the folder `mav0`), TUM-VI or Kalibr, also without
/// calibration or lists. @pre is_asl_folder(path)
[[nodiscard]] OpenedImport open_asl_import(const std::string& path, const ImportOptions& options);

/// A table of an IMU, without images.
[[nodiscard]] OpenedImport open_imu_import(const std::string& path, const ImportOptions& options);

/// A video file, alone or with a table of an IMU (`options.imu_csv`).
///
/// A video has no absolute time. A table whose first time is within a minute of zero counts from
/// the video's first image; any other begins with it. `options.imu_offset` is added.
[[nodiscard]] OpenedImport open_video_import(const std::string& path, const ImportOptions& options);

/// A recording of the app Sensor Logger (iOS, Android): its ZIP archive, or the folder with
/// Gyroscope.csv, Accelerometer.csv and Gravity.csv (or TotalAcceleration.csv) and Camera/.
///
/// Axes are the phone's (x right, y up, z out of the screen), and specific force has Android's
/// sign; iOS has the other one unless the app standardises it, which Metadata.csv records.
[[nodiscard]] OpenedImport open_sensor_logger(const std::string& path,
                                              const ImportOptions& options);

[[nodiscard]] bool is_asl_folder(const std::string& path);
/// Gyroscope.csv is there.
[[nodiscard]] bool is_sensor_logger_folder(const std::string& path);

enum class RosType { kImage, kCompressedImage, kImu, kCameraInfo, kOther };
[[nodiscard]] RosType ros_type(const LoggedTopic& topic);

struct LogSurvey {
  std::vector<FoundStream> streams;  ///< In order of appearance.
  std::vector<std::string> others;
  std::vector<std::string> remarks;
};

/// Reads a log to its end: counts, stamps, sizes, lenses. Images are not decoded.
/// @param log_stamps  the recorder's time instead of that in the header
[[nodiscard]] Expected<LogSurvey> survey_log(MessageLog& log, bool log_stamps,
                                             const ImportProgress& progress);

struct ListedImage {
  std::int64_t ns{};
  std::string file;
};

/// An import whose readings and images are in different files: first the IMU, then one camera after
/// the other. Unreadable images and those of another size are left out and logged once.
class PartsImport : public ImportSource {
 public:
  const std::vector<FoundStream>& streams() const final { return streams_; }
  std::vector<std::string> remarks() const final { return remarks_; }
  OpenedSource open(const ImportChoice& choice, const std::vector<CameraMount>& cameras) final;

 protected:
  /// Image files, or a video.
  struct Camera {
    std::vector<ListedImage> files;
    std::string video;
    Duration begins{0};  ///< Stamp of the video's first image.
  };
  /// @param clock  of videos
  explicit PartsImport(const Clock* clock) : clock_(clock) {}

  void add_camera(FoundStream found, Camera camera) {
    streams_.push_back(std::move(found));
    cameras_.push_back(std::move(camera));
  }
  /// A stream of `files`, which are not empty. @return Error when the first is not readable
  [[nodiscard]] static Expected<FoundStream> stream_of(std::string name,
                                                       const std::vector<ListedImage>& files);
  void add_imu(FoundStream found, std::vector<ImuSample> samples) {
    add_camera(std::move(found), {});
    imu_ = std::move(samples);
  }

  std::vector<FoundStream> streams_;
  std::vector<std::string> remarks_;

 private:
  const Clock* clock_;
  std::vector<Camera> cameras_;  ///< Per stream; the IMU's is empty.
  std::vector<ImuSample> imu_;
};

/// Image files of a folder whose names are times, sorted by them.
/// @param exponent  their unit is 10^this ns; −1: by stamp_exponent of the first
[[nodiscard]] std::vector<ListedImage> pictures_by_time(const std::string& folder, int exponent);

[[nodiscard]] Expected<FoundStream> look_at_video(const std::string& path, const Clock& clock);

}  // namespace fiducap
