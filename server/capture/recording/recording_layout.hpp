#pragma once

#include <filesystem>
#include <string>

#include "base/expected.hpp"

namespace fiducap {

/// Names of the EuRoC/ASL folder layout, extended by detections. Reader and writer share them.
class RecordingLayout final {
 public:
  explicit RecordingLayout(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// Accepts the folder that holds `mav0`, or `mav0` itself.
  [[nodiscard]] static Expected<RecordingLayout> find(const std::filesystem::path& folder);

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] std::filesystem::path mav() const { return folder_ / "mav0"; }
  [[nodiscard]] std::filesystem::path camera(std::size_t k) const {
    return mav() / ("cam" + std::to_string(k));
  }
  [[nodiscard]] std::filesystem::path camera_yaml(std::size_t k) const {
    return camera(k) / "sensor.yaml";
  }
  [[nodiscard]] std::filesystem::path images_csv(std::size_t k) const {
    return camera(k) / "data.csv";
  }
  [[nodiscard]] std::filesystem::path images(std::size_t k) const { return camera(k) / "data"; }
  [[nodiscard]] std::filesystem::path detections(std::size_t k) const {
    return mav() / ("tags" + std::to_string(k));
  }
  [[nodiscard]] std::filesystem::path corners_csv(std::size_t k) const {
    return detections(k) / "data.csv";
  }
  [[nodiscard]] std::filesystem::path frames_csv(std::size_t k) const {
    return detections(k) / "frames.csv";
  }
  [[nodiscard]] std::filesystem::path imu() const { return mav() / "imu0"; }
  [[nodiscard]] std::filesystem::path imu_yaml() const { return imu() / "sensor.yaml"; }
  [[nodiscard]] std::filesystem::path imu_csv() const { return imu() / "data.csv"; }
  [[nodiscard]] std::filesystem::path odometry() const { return mav() / "odom0"; }
  [[nodiscard]] std::filesystem::path odometry_yaml() const { return odometry() / "sensor.yaml"; }
  [[nodiscard]] std::filesystem::path odometry_csv() const { return odometry() / "data.csv"; }
  /// As a phone's recorder of InvisibleMap writes it.
  [[nodiscard]] std::filesystem::path phone_odometry_csv() const {
    return folder_ / "vio_odom.csv";
  }
  [[nodiscard]] std::filesystem::path tags_yaml() const { return mav() / "tags.yaml"; }
  [[nodiscard]] std::filesystem::path state() const {
    return mav() / "state_groundtruth_estimate0";
  }
  [[nodiscard]] std::filesystem::path state_csv() const { return state() / "data.csv"; }
  [[nodiscard]] std::filesystem::path truth() const { return folder_ / "truth"; }
  [[nodiscard]] std::filesystem::path truth_tags_csv() const { return truth() / "tags.csv"; }
  [[nodiscard]] std::filesystem::path truth_extrinsics_yaml() const {
    return truth() / "extrinsics.yaml";
  }
  [[nodiscard]] std::filesystem::path reference_poses_csv() const {
    return truth() / "reference_poses.csv";
  }

 private:
  std::filesystem::path folder_;
};

/// Never throws; false when it cannot be looked at.
[[nodiscard]] inline bool is_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}
[[nodiscard]] inline bool is_folder(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

}  // namespace fiducap
