#pragma once

#include <filesystem>
#include <string>

#include "base/expected.hpp"

namespace fiducap {

/// Names of the EuRoC/ASL folder layout, extended by detections. Reader and writer share them.
class RecordingLayout final {
 public:
  using Path = std::filesystem::path;

  /// @param mav  `.`: cameras and IMU are in the folder itself, as Kalibr has them
  explicit RecordingLayout(Path folder, const char* mav = "mav0")
      : folder_(std::move(folder)), mav_(folder_ / mav) {}
  /// Accepts the folder that holds `mav0`, or `mav0` itself.
  [[nodiscard]] static Expected<RecordingLayout> find(const Path& folder);

  [[nodiscard]] const Path& folder() const { return folder_; }
  [[nodiscard]] Path mav() const { return mav_; }
  [[nodiscard]] Path camera(std::size_t k) const { return mav() / ("cam" + std::to_string(k)); }
  [[nodiscard]] Path camera_yaml(std::size_t k) const { return camera(k) / "sensor.yaml"; }
  [[nodiscard]] Path images_csv(std::size_t k) const { return camera(k) / "data.csv"; }
  [[nodiscard]] Path images(std::size_t k) const { return camera(k) / "data"; }
  [[nodiscard]] Path detections(std::size_t k) const {
    return mav() / ("tags" + std::to_string(k));
  }
  [[nodiscard]] Path corners_csv(std::size_t k) const { return detections(k) / "data.csv"; }
  [[nodiscard]] Path frames_csv(std::size_t k) const { return detections(k) / "frames.csv"; }
  [[nodiscard]] Path imu_yaml() const { return mav() / "imu0" / "sensor.yaml"; }
  [[nodiscard]] Path imu_csv() const { return mav() / "imu0" / "data.csv"; }
  [[nodiscard]] Path odometry_yaml() const { return mav() / "odom0" / "sensor.yaml"; }
  [[nodiscard]] Path odometry_csv() const { return mav() / "odom0" / "data.csv"; }
  /// As InvisibleMap's recorder on phones writes it.
  [[nodiscard]] Path phone_odometry_csv() const { return folder_ / "vio_odom.csv"; }
  [[nodiscard]] Path tags_yaml() const { return mav() / "tags.yaml"; }
  [[nodiscard]] Path state() const { return mav() / "state_groundtruth_estimate0"; }
  [[nodiscard]] Path state_csv() const { return state() / "data.csv"; }
  /// Truth of other programs, in the same columns: TUM-VI's poses of the body, EuRoC's of markers.
  [[nodiscard]] Path motion_capture() const { return mav() / "mocap0"; }
  [[nodiscard]] Path markers() const { return mav() / "vicon0"; }
  [[nodiscard]] Path truth() const { return folder_ / "truth"; }
  [[nodiscard]] Path truth_tags_csv() const { return truth() / "tags.csv"; }
  [[nodiscard]] Path truth_extrinsics_yaml() const { return truth() / "extrinsics.yaml"; }
  [[nodiscard]] Path reference_poses_csv() const { return truth() / "reference_poses.csv"; }

 private:
  Path folder_;
  Path mav_;
};

inline constexpr const char* kZipArchive = "a ZIP archive";
/// What a log of another program is, by its first bytes or its files: "a bag of ROS 1", … Empty:
/// no log that is known.
[[nodiscard]] std::string log_kind(const std::filesystem::path& path);

/// Never throws; false when it is not accessible.
[[nodiscard]] inline bool is_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}
[[nodiscard]] inline bool is_folder(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

}  // namespace fiducap
