// A simulated walk with rendered images, stored as ROS 2 records it, imported and replayed.
#include <gmock/gmock.h>

#include <filesystem>

#include "support/command_run.hpp"
#include "support/log_files.hpp"
#include "support/ros_bytes.hpp"
#include "support/temporary_folder.hpp"
#include "unit/tools/import/recorded_samples.hpp"

namespace fiducap {
namespace {

using test::RosDialect;

test::StoredMessage message_of(const SensorSample& sample) {
  const std::int64_t ns = to_ns(time_of(sample));
  if (const auto* imu = std::get_if<ImuSample>(&sample)) {
    const auto& w = imu->w_WB_B;
    const auto& f = imu->f_B;
    return {
        "/imu0", "sensor_msgs/Imu", ns,
        test::imu_message(RosDialect::kCdrBig, ns, {w.x(), w.y(), w.z()}, {f.x(), f.y(), f.z()})};
  }
  const GrayImage& image = *std::get<CameraFrame>(sample).image;
  const std::string pixels(image.pixels.begin(), image.pixels.end());
  return {"/cam0/image_raw", "sensor_msgs/Image", ns,
          test::image_message(RosDialect::kCdrLittle, ns, static_cast<std::uint32_t>(image.width),
                              static_cast<std::uint32_t>(image.height), pixels)};
}

TEST(ImportReplay, ImportedWalkIsExactAndReplayed) {
  const TemporaryFolder folder;
  const auto run = [](const std::vector<std::string>& words) {
    const auto done = run_fiducap(words);
    ASSERT_EQ(done.code, kExitOk) << done.err << done.out;
  };
  const std::string simulated = folder.file("walk");
  const std::string imported = folder.file("imported");
  run({"simulate", "--room", "table", "--seconds", "4", "--images", "--out", simulated});
  const std::vector<SensorSample> walk = recorded_samples(simulated);
  std::vector<test::StoredMessage> messages;
  for (const SensorSample& sample : walk) messages.push_back(message_of(sample));
  test::LogFileOptions options{"zstd", 50};
  options.ros2 = true;
  run({"import", folder.write("walk.mcap", test::mcap_file(messages, options)), "--out", imported,
       "--calibration", folder.file("walk/mav0/cam0/sensor.yaml"), "--tag-size",
       std::to_string(value_of(read_recording_info(simulated)).tag_size_m)});

  const std::vector<SensorSample> again = recorded_samples(imported);
  ASSERT_EQ(again.size(), walk.size());
  for (std::size_t i = 0; i < walk.size(); ++i) {
    ASSERT_EQ(time_of(again[i]), time_of(walk[i])) << i;
    if (const auto* imu = std::get_if<ImuSample>(&walk[i])) {
      ASSERT_EQ(std::get<ImuSample>(again[i]).w_WB_B, imu->w_WB_B) << i;
      ASSERT_EQ(std::get<ImuSample>(again[i]).f_B, imu->f_B) << i;
    } else {
      ASSERT_EQ(std::get<CameraFrame>(again[i]).image->pixels,
                std::get<CameraFrame>(walk[i]).image->pixels)
          << i;
    }
  }
  run({"replay", imported, "--out", folder.file("results")});
  EXPECT_TRUE(std::filesystem::exists(folder.file("results/imported.tum")));
}

}  // namespace
}  // namespace fiducap
