#include "capture/import/import_parts.hpp"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>

#include "support/log_files.hpp"
#include "support/results.hpp"
#include "support/ros_bytes.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using test::RosDialect;
using test::StoredMessage;
using testing::HasSubstr;

constexpr std::int64_t kBegin_ns = 1'600'000'000'000'000'000;
constexpr std::int64_t kLate_ns = 30'000'000;  // delay of the recorder

std::string png() {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(77)), bytes);
  return {bytes.begin(), bytes.end()};
}

std::vector<StoredMessage> walk() {
  std::vector<StoredMessage> messages;
  const auto add = [&](const char* topic, const char* type, std::int64_t ns, std::string bytes) {
    messages.push_back({topic, type, ns + kLate_ns, std::move(bytes)});
  };
  for (std::int64_t i = 0; i < 10; ++i) {
    const std::int64_t ns = kBegin_ns + i * 5'000'000;
    add("/imu", "sensor_msgs/Imu", ns,
        test::imu_message(RosDialect::kRos1, ns, {0.1, 0.2, 0.3}, {0, 0, 9.8}));
    if (i % 5 != 0) continue;
    add("/cam/camera_info", "sensor_msgs/CameraInfo", ns,
        test::camera_info_message(RosDialect::kRos1, ns, 8, 6, 10));
    add("/cam/image_raw", "sensor_msgs/Image", ns,
        test::image_message(RosDialect::kRos1, ns, 8, 6, std::string(48, 'x')));
    add("/front/image/compressed", "sensor_msgs/CompressedImage", ns,
        test::compressed_message(RosDialect::kRos1, ns, png()));
    add("/depth/image_raw", "sensor_msgs/Image", ns,
        test::image_message(RosDialect::kRos1, ns, 8, 6, std::string(96, 'd'), "16UC1"));
    add("/scan", "sensor_msgs/LaserScan", ns, "whatever");
  }
  return messages;
}

class LogImportTest : public testing::Test {
 protected:
  std::unique_ptr<ImportSource> open(const std::vector<StoredMessage>& messages) {
    return value_of(
        open_log_import({folder_.write("a.bag", test::bag_file(messages))}, options_, {}));
  }
  TemporaryFolder folder_;
  ImportOptions options_;
};

const FoundStream& stream(const ImportSource& source, const std::string& name) {
  for (const FoundStream& one : source.streams())
    if (one.name == name) return one;
  ADD_FAILURE() << name;
  return source.streams().front();
}

TEST_F(LogImportTest, CountsTopicsWithSizesAndLenses) {
  const auto source = open(walk());
  const FoundStream& imu = stream(*source, "/imu");
  EXPECT_EQ(imu.count, 10u);
  EXPECT_EQ(imu.first_ns, kBegin_ns);
  EXPECT_NEAR(imu.rate_hz(), 200, 1e-6);
  const FoundStream& camera = stream(*source, "/cam/image_raw");
  EXPECT_EQ(camera.count, 2u);
  EXPECT_TRUE(camera.lens_known);
  EXPECT_EQ(camera.mount.model.fu, 10);
  const FoundStream& compressed = stream(*source, "/front/image/compressed");
  EXPECT_EQ(compressed.mount.model.width, 8);
  EXPECT_FALSE(compressed.lens_known);
  EXPECT_THAT(compressed.lens_fault, HasSubstr("/front/camera_info"));
  EXPECT_TRUE(stream(*source, "/depth/image_raw").is_depth);
  EXPECT_THAT(source->others(), testing::Contains("/scan (sensor_msgs/LaserScan, 2 messages)"));
}

TEST_F(LogImportTest, SixteenBitsAreADepthByTheNameOfTheTopic) {
  auto messages = walk();
  for (StoredMessage& message : messages)
    if (message.topic == "/depth/image_raw") message.topic = "/orange/image_raw";
  EXPECT_FALSE(stream(*open(messages), "/orange/image_raw").is_depth);
}

TEST_F(LogImportTest, FindsTheLensOfATopicWithoutFirstSlash) {
  auto messages = walk();
  for (StoredMessage& message : messages)
    if (message.topic == "/cam/image_raw") message.topic = "cam/image_raw";
  EXPECT_TRUE(stream(*open(messages), "cam/image_raw").lens_known);
}

TEST_F(LogImportTest, CountsStampsThatAreZeroOrGoBack) {
  std::vector<StoredMessage> messages;
  for (const std::int64_t ns : {kBegin_ns, std::int64_t{0}, kBegin_ns + 10, kBegin_ns + 5})
    messages.push_back(
        {"/imu", "sensor_msgs/Imu", kBegin_ns, test::imu_message(RosDialect::kRos1, ns, {}, {})});
  messages.push_back({"/imu", "sensor_msgs/Imu", kBegin_ns, "cut"});
  const auto source = open(messages);
  const FoundStream& imu = stream(*source, "/imu");
  EXPECT_EQ(imu.count, 4u);
  EXPECT_EQ(imu.zero_stamps, 1u);
  EXPECT_EQ(imu.backwards, 1u);
  EXPECT_EQ(imu.unreadable, 1u);
  EXPECT_THAT(imu.first_fault, HasSubstr("sensor_msgs/Imu: needs"));
}

}  // namespace
}  // namespace fiducap
