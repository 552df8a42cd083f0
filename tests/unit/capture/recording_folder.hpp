#pragma once

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "capture/recording/recording.hpp"
#include "support/fake_clock.hpp"
#include "support/new_log.hpp"
#include "support/temporary_folder.hpp"
#include "unit/capture/sample_stamps.hpp"

namespace fiducap {

inline constexpr const char* kCamera = R"(sensor_type: camera
T_BS: {cols: 4, rows: 4, data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]}
rate_hz: 10
resolution: [40, 30]
camera_model: pinhole
intrinsics: [20, 21, 19.5, 14.5]
distortion_model: radial-tangential
distortion_coefficients: [-0.1, 0.01, 0.001, 0.002]
timeshift_cam_imu: 0.002
T_BS_sigma: {translation_m: 0.01, rotation_rad: 0.02}
)";
inline constexpr const char* kImu = R"(sensor_type: imu
T_BS: {cols: 4, rows: 4, data: [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}
rate_hz: 200
gyroscope_noise_density: 1e-4
gyroscope_random_walk: 2e-5
accelerometer_noise_density: 3e-3
accelerometer_random_walk: 4e-4
)";
inline constexpr const char* kTags = R"(family: tag25h9
default_size_m: 0.2
reference_tag: 3
sizes_m: {7: 0.05}
ignore_tags: [9, 11]  # twins
max_hamming: 1
plane: {tags: [1, 2], normal: [0, 0, 1]}
boards:
  - {anything: 1}
known_tags:
  - {id: 3, size_m: 0.2, position: [1, 2, 3], orientation_wxyz: [0.5, 0.5, 0.5, 0.5],
     position_sigma_m: 0.01, rotation_sigma_rad: 0.02}
)";
inline constexpr const char* kCorners =
    "#timestamp [ns],tag_id [],hamming [],u0 [px],v0 [px],u1 [px],v1 [px],u2 [px],v2 [px],u3 "
    "[px],v3 [px]\n"
    "1000100000000,5,0,1.5,2.5,3,4,5,6,7,8\n"
    "1000100000000,6,1,11,12,13,14,15,16,17,18\n"
    "1000300000000,5,2,1,2,3,4,5,6,7,8.25\n";
inline constexpr const char* kFrames =
    "#timestamp [ns],detections "
    "[]\n1000000000000,0\n1000100000000,2\n1000200000000,0\n1000300000000,1\n";

class RecordingTest : public testing::Test {
 protected:
  void write_basics() {
    folder_.write("mav0/cam0/sensor.yaml", kCamera);
    folder_.write("mav0/tags.yaml", kTags);
  }
  void write_corners(const std::string& corners = kCorners, const std::string& frames = kFrames) {
    write_basics();
    folder_.write("mav0/tags0/data.csv", corners);
    if (!frames.empty()) folder_.write("mav0/tags0/frames.csv", frames);
  }
  void write_imu(const std::string& rows) {
    folder_.write("mav0/imu0/sensor.yaml", kImu);
    folder_.write("mav0/imu0/data.csv", "#timestamp [ns],w,w,w,a,a,a\n" + rows);
  }
  void write_truth(const std::string& rows) {
    folder_.write("mav0/state_groundtruth_estimate0/data.csv", rows);
  }
  void write_image(const std::string& name, int width = 40, int height = 30) {
    std::filesystem::create_directories(folder_.path() / "mav0/cam0/data");
    cv::Mat image(height, width, CV_8UC1);
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u)
        image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(3 * u + 2 * v);
    ASSERT_TRUE(cv::imwrite((folder_.path() / "mav0/cam0/data" / name).string(), image));
  }
  RecordingInfo info() const { return value_of(read_recording_info(folder_.text())); }
  std::string info_error() const { return error_of(read_recording_info(folder_.text())); }
  std::unique_ptr<SensorSource> open(const RecordingPlayback& playback = {}) {
    return value_of(open_recording(info(), playback, clock_));
  }
  std::vector<SensorSample> play(const RecordingPlayback& playback = {},
                                 std::size_t at_most = 1000) {
    return play_all(*open(playback), at_most);
  }
  std::vector<std::int64_t> played_ms(const RecordingPlayback& playback = {},
                                      std::size_t at_most = 1000) {
    return stamps_ms(play(playback, at_most));
  }
  /// Number of tags in each image.
  std::vector<std::size_t> played_tags() {
    std::vector<std::size_t> tags;
    for (const SensorSample& sample : play())
      tags.push_back(std::get<CornerFrame>(sample).tags.size());
    return tags;
  }

  TemporaryFolder folder_;
  FakeClock clock_{instant_from_ns(5'000'000'000)};
  NewLog log_;
};

class CornerRecordingTest : public RecordingTest {
 protected:
  CornerRecordingTest() { write_corners(); }
};

}  // namespace fiducap
