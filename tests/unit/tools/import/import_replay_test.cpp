// A simulated walk with rendered images, as ROS 2 would have recorded it: what the import makes of
// it is the walk again, and a replay of it has poses.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "capture/recording/recording_source.hpp"
#include "support/log_files.hpp"
#include "support/ros_bytes.hpp"
#include "support/temporary_folder.hpp"
#include "tools/import/import.hpp"
#include "tools/replay/replay_verbs.hpp"

namespace fiducap {
namespace {

using test::RosDialect;

constexpr double kWalk_s = 4;

std::vector<SensorSample> samples_of(const std::string& folder) {
  static GrayImagePool pool;
  std::vector<SensorSample> all;
  auto streams = open_streams(read_recording_info(folder).value(), pool);
  for (SampleStream& stream : streams.value()) {
    const auto next = [&] { return std::visit([](auto& s) { return s.next(); }, stream); };
    for (auto sample = next(); sample; sample = next()) all.push_back(std::move(*sample));
  }
  return all;
}

std::vector<test::StoredMessage> messages_of(const std::vector<SensorSample>& samples) {
  std::vector<test::StoredMessage> messages;
  for (const SensorSample& sample : samples) {
    const std::int64_t ns = to_ns(time_of(sample));
    if (const auto* imu = std::get_if<ImuSample>(&sample)) {
      const auto& w = imu->w_WB_B;
      const auto& f = imu->f_B;
      messages.push_back({"/imu0", "sensor_msgs/Imu", ns,
                          test::imu_message(RosDialect::kCdrBig, ns, {w.x(), w.y(), w.z()},
                                            {f.x(), f.y(), f.z()})});
      continue;
    }
    const GrayImage& image = *std::get<CameraFrame>(sample).image;
    const std::string pixels(image.pixels.begin(), image.pixels.end());
    messages.push_back(
        {"/cam0/image_raw", "sensor_msgs/Image", ns,
         test::image_message(RosDialect::kCdrLittle, ns, static_cast<std::uint32_t>(image.width),
                             static_cast<std::uint32_t>(image.height), pixels)});
  }
  return messages;
}

TEST(ImportReplay, AWalkComesBackToTheLastBitAndIsReplayed) {
  const TemporaryFolder folder;
  std::ostringstream out, err;
  const Terminal terminal{out, err};
  SimulateArguments simulate;
  simulate.out = folder.file("walk");
  simulate.room = "table";
  simulate.seconds = kWalk_s;
  simulate.images = true;
  ASSERT_EQ(run_simulate(simulate, terminal), kExitOk) << err.str();
  const std::vector<SensorSample> walk = samples_of(simulate.out);

  test::LogFileOptions options{"zstd", 50};
  options.ros2 = true;
  ImportArguments arguments;
  arguments.source = folder.write("walk.mcap", test::mcap_file(messages_of(walk), options));
  arguments.out = folder.file("imported");
  arguments.calibrations = {folder.file("walk/mav0/cam0/sensor.yaml")};
  arguments.tag_size_m = read_recording_info(simulate.out)->tag_size_m;
  ASSERT_EQ(run_import(arguments, terminal), kExitOk) << err.str() << out.str();

  const std::vector<SensorSample> imported = samples_of(arguments.out);
  ASSERT_EQ(imported.size(), walk.size());
  for (std::size_t i = 0; i < walk.size(); ++i) {
    ASSERT_EQ(time_of(imported[i]), time_of(walk[i])) << i;
    if (const auto* imu = std::get_if<ImuSample>(&walk[i])) {
      ASSERT_EQ(std::get<ImuSample>(imported[i]).w_WB_B, imu->w_WB_B) << i;
      ASSERT_EQ(std::get<ImuSample>(imported[i]).f_B, imu->f_B) << i;
    } else {
      ASSERT_EQ(std::get<CameraFrame>(imported[i]).image->pixels,
                std::get<CameraFrame>(walk[i]).image->pixels)
          << i;
    }
  }

  ReplayArguments replay;
  replay.recordings = {arguments.out};
  replay.out = folder.file("results");
  EXPECT_EQ(run_replay(replay, terminal), kExitOk) << err.str() << out.str();
  std::ifstream poses(folder.file("results/imported.tum"));
  EXPECT_TRUE(poses.good());
}

}  // namespace
}  // namespace fiducap
