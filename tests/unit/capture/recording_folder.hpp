#pragma once

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "base/log.hpp"
#include "capture/recording/recording.hpp"
#include "support/fake_clock.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {

inline constexpr const char* kCamera =
    "sensor_type: camera\n"
    "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\n"
    "rate_hz: 10\nresolution: [40, 30]\ncamera_model: pinhole\nintrinsics: [20, 21, 19.5, 14.5]\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [-0.1, 0.01, 0.001, 0.002]\n"
    "timeshift_cam_imu: 0.002\nT_BS_sigma: {translation_m: 0.01, rotation_rad: 0.02}\n";
inline constexpr const char* kImu =
    "sensor_type: imu\n"
    "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
    "rate_hz: 200\ngyroscope_noise_density: 1e-4\ngyroscope_random_walk: 2e-5\n"
    "accelerometer_noise_density: 3e-3\naccelerometer_random_walk: 4e-4\n";
inline constexpr const char* kTags =
    "family: tag25h9\ndefault_size_m: 0.2\nreference_tag: 3\nsizes_m: {7: 0.05}\nignore_tags: [9, "
    "11]  # twins\n"
    "max_hamming: 1\nplane: {tags: [1, 2], normal: [0, 0, 1]}\nboards:\n  - {anything: 1}\n"
    "known_tags:\n  - {id: 3, size_m: 0.2, position: [1, 2, 3], orientation_wxyz: [0.5, 0.5, 0.5, "
    "0.5],"
    " position_sigma_m: 0.01, rotation_sigma_rad: 0.02}\n";
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
  void write_image(const std::string& name, int width = 40, int height = 30) {
    std::filesystem::create_directories(folder_.path() / "mav0/cam0/data");
    cv::Mat image(height, width, CV_8UC1);
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u)
        image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(3 * u + 2 * v);
    }
    ASSERT_TRUE(cv::imwrite((folder_.path() / "mav0/cam0/data" / name).string(), image));
  }
  std::unique_ptr<SensorSource> open(const RecordingPlayback& playback = {}) {
    const auto info = read_recording_info(folder_.text());
    EXPECT_TRUE(info) << info.error().text();
    auto source = open_recording(info.value(), playback, clock_);
    EXPECT_TRUE(source) << source.error().text();
    return std::move(source.value());
  }
  std::vector<SensorSample> play(const RecordingPlayback& playback = {},
                                 std::size_t at_most = 1000) {
    const auto source = open(playback);
    std::vector<SensorSample> samples;
    while (samples.size() < at_most) {
      auto sample = source->next({});
      EXPECT_TRUE(sample);
      if (!sample || !*sample) break;
      samples.push_back(std::move(**sample));
    }
    return samples;
  }
  static std::vector<std::int64_t> stamps_ms(const std::vector<SensorSample>& samples) {
    std::vector<std::int64_t> stamps;
    for (const SensorSample& sample : samples) stamps.push_back(to_ns(time_of(sample)) / 1'000'000);
    return stamps;
  }
  // What the log said since the test began.
  std::string log_text() const {
    std::string all;
    for (const log::Line& line : log::lines_after(first_log_line_)) all += line.text + "\n";
    return all;
  }

  TemporaryFolder folder_;
  FakeClock clock_{instant_from_ns(5'000'000'000)};

 private:
  static std::uint64_t newest_log_line() {
    const auto lines = log::lines_after(0);
    return lines.empty() ? 0 : lines.back().number;
  }
  std::uint64_t first_log_line_{newest_log_line()};
};

}  // namespace fiducap
