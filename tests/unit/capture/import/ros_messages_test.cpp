#include "capture/import/ros_messages.hpp"

#include <gmock/gmock.h>

#include "support/lens_models.hpp"
#include "support/results.hpp"
#include "support/ros_bytes.hpp"

namespace fiducap::ros {
namespace {

using test::RosDialect;
using testing::HasSubstr;

constexpr std::int64_t kStamp_ns = 1'600'000'000'123'456'789;

class RosMessagesTest : public testing::TestWithParam<RosDialect> {
 protected:
  RosDialect dialect_ = GetParam();
  MessageFormat format_ =
      dialect_ == RosDialect::kRos1 ? MessageFormat::kRos1 : MessageFormat::kCdr;
};

TEST_P(RosMessagesTest, ReadsAnImu) {
  const std::string message = test::imu_message(dialect_, kStamp_ns, {1, -2, 3}, {0.5, 9.75, -4});
  const auto imu = value_of(read_imu(format_, bytes_of(message)));
  EXPECT_EQ(imu.stamp_ns, kStamp_ns);
  EXPECT_EQ(imu.w, Eigen::Vector3d(1, -2, 3));
  EXPECT_EQ(imu.f, Eigen::Vector3d(0.5, 9.75, -4));
}

TEST_P(RosMessagesTest, ReadsAnImage) {
  const std::string message = test::image_message(dialect_, kStamp_ns, 3, 2, "abcdef");
  const auto [stamp_ns, image] = value_of(read_image(format_, bytes_of(message)));
  EXPECT_EQ(stamp_ns, kStamp_ns);
  EXPECT_EQ(image.width, 3u);
  EXPECT_EQ(image.height, 2u);
  EXPECT_EQ(image.encoding, "mono8");
  EXPECT_EQ(image.step, 3u);
  EXPECT_THAT(image.data, testing::ElementsAre('a', 'b', 'c', 'd', 'e', 'f'));
}

TEST_P(RosMessagesTest, ReadsACompressedImage) {
  const std::string message = test::compressed_message(dialect_, kStamp_ns, "picture");
  const auto read = value_of(read_compressed(format_, bytes_of(message)));
  EXPECT_EQ(read.image.encoding, "mono8; png compressed");
  EXPECT_EQ(read.image.data.size(), 7u);
}

TEST_P(RosMessagesTest, ReadsALens) {
  const std::string message = test::camera_info_message(dialect_, kStamp_ns, 640, 480, 500);
  const CameraModel lens = value_of(read_lens(format_, bytes_of(message)));
  EXPECT_EQ(parts_of(lens),
            parts_of(radial_tangential({640, 480, 500, 500, 320, 240}, {-0.1, 0.02, 1e-3, 2e-3})));
}

TEST_P(RosMessagesTest, RefusesEveryTruncatedMessage) {
  const std::string imu = test::imu_message(dialect_, kStamp_ns, {}, {});
  const std::string image = test::image_message(dialect_, kStamp_ns, 3, 2, "abcdef");
  for (std::size_t n = 0; n < imu.size(); ++n)
    EXPECT_FALSE(read_imu(format_, bytes_of(imu).first(n))) << n;
  for (std::size_t n = 0; n < image.size(); ++n)
    EXPECT_FALSE(read_image(format_, bytes_of(image).first(n))) << n;
  EXPECT_THAT(error_of(read_image(format_, bytes_of(image).first(image.size() - 1))),
              HasSubstr("sensor_msgs/Image: needs"));
}

INSTANTIATE_TEST_SUITE_P(AllDialects, RosMessagesTest,
                         testing::Values(RosDialect::kRos1, RosDialect::kCdrLittle,
                                         RosDialect::kCdrBig));

// std_msgs/Header of ROS 2 for 1 s, 2 ns, axes "a", then a double, written by hand.
TEST(RosFields, AlignDoublesOfCdrToEightBytes) {
  const std::string message("\0\1\0\0\1\0\0\0\2\0\0\0\2\0\0\0a\0\0\0\0\0\0\0\0\0\xf0\x3f", 28);
  auto from = value_of(RosFields::open(MessageFormat::kCdr, bytes_of(message)));
  EXPECT_EQ(from.header_stamp_ns(), 1'000'000'002);
  EXPECT_EQ(from.f64(), 1.0);
  EXPECT_TRUE(from.check("it"));
}

TEST(RosFields, NameUnknownRepresentations) {
  EXPECT_THAT(error_of(RosFields::open(MessageFormat::kCdr, bytes_of({"\0\7\0\0", 4}))),
              HasSubstr("representation 7"));
}

}  // namespace
}  // namespace fiducap::ros
