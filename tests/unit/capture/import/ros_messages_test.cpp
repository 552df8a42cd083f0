#include "capture/import/ros_messages.hpp"

#include <gmock/gmock.h>

#include "support/ros_bytes.hpp"

namespace fiducap::ros {
namespace {

using test::RosDialect;
using testing::ElementsAre;

constexpr std::int64_t kStamp_ns = 1'600'000'000'123'456'789;

MessageFormat format_of(RosDialect dialect) {
  return dialect == RosDialect::kRos1 ? MessageFormat::kRos1 : MessageFormat::kCdr;
}
std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

class RosMessagesTest : public testing::TestWithParam<RosDialect> {
 protected:
  RosDialect dialect_ = GetParam();
  MessageFormat format_ = format_of(GetParam());
};

TEST_P(RosMessagesTest, AnImuIsRead) {
  const std::string message = test::imu_message(dialect_, kStamp_ns, {1, -2, 3}, {0.5, 9.75, -4});
  const auto imu = read_imu(format_, bytes_of(message));
  ASSERT_TRUE(imu) << imu.error().text();
  EXPECT_EQ(imu->stamp_ns, kStamp_ns);
  EXPECT_EQ(imu->w, Eigen::Vector3d(1, -2, 3));
  EXPECT_EQ(imu->f, Eigen::Vector3d(0.5, 9.75, -4));
}

TEST_P(RosMessagesTest, AnImageIsRead) {
  const std::string message = test::image_message(dialect_, kStamp_ns, 3, 2, "abcdef");
  const auto read = read_image(format_, bytes_of(message));
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->stamp_ns, kStamp_ns);
  EXPECT_EQ(read->image.width, 3u);
  EXPECT_EQ(read->image.height, 2u);
  EXPECT_EQ(read->image.encoding, "mono8");
  EXPECT_EQ(read->image.step, 3u);
  EXPECT_THAT(read->image.data, ElementsAre('a', 'b', 'c', 'd', 'e', 'f'));
}

TEST_P(RosMessagesTest, ACompressedImageIsRead) {
  const std::string message = test::compressed_message(dialect_, kStamp_ns, "picture");
  const auto read = read_compressed(format_, bytes_of(message));
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->format, "mono8; png compressed");
  EXPECT_EQ(read->data.size(), 7u);
}

TEST_P(RosMessagesTest, ALensIsRead) {
  const std::string message = test::camera_info_message(dialect_, kStamp_ns, 640, 480, 500);
  const auto lens = read_lens(format_, bytes_of(message));
  ASSERT_TRUE(lens) << lens.error().text();
  EXPECT_EQ(lens->width, 640);
  EXPECT_EQ(lens->fu, 500);
  EXPECT_EQ(lens->cv, 240);
  EXPECT_EQ(lens->distortion, Distortion::kRadialTangential);
  EXPECT_THAT(lens->coefficients, ElementsAre(-0.1, 0.02, 1e-3, 2e-3, 0));
}

TEST_P(RosMessagesTest, EveryCutMessageIsAnErrorThatSaysWhatIsMissing) {
  const std::string imu = test::imu_message(dialect_, kStamp_ns, {}, {});
  const std::string image = test::image_message(dialect_, kStamp_ns, 3, 2, "abcdef");
  for (std::size_t n = 0; n < imu.size(); ++n)
    EXPECT_FALSE(read_imu(format_, bytes_of(imu).first(n))) << n;
  for (std::size_t n = 0; n < image.size(); ++n)
    EXPECT_FALSE(read_image(format_, bytes_of(image).first(n))) << n;
  const auto cut = read_image(format_, bytes_of(image).first(image.size() - 1));
  EXPECT_THAT(cut.error().text(), testing::HasSubstr("sensor_msgs/Image: needs"));
}

INSTANTIATE_TEST_SUITE_P(AllDialects, RosMessagesTest,
                         testing::Values(RosDialect::kRos1, RosDialect::kCdrLittle,
                                         RosDialect::kCdrBig));

// std_msgs/Header of ROS 2 for 1 s, 2 ns, axes "a", then a double: written down by hand.
TEST(RosFields, ADoubleOfCdrBeginsAtAMultipleOfEight) {
  const std::string message(
      "\0\1\0\0"
      "\1\0\0\0"
      "\2\0\0\0"
      "\2\0\0\0"
      "a\0\0\0"
      "\0\0\0\0\0\0\xf0\x3f",
      28);
  auto from = RosFields::open(MessageFormat::kCdr, bytes_of(message));
  ASSERT_TRUE(from);
  EXPECT_EQ(from->header_stamp_ns(), 1'000'000'002);
  EXPECT_EQ(from->f64(), 1.0);
  EXPECT_TRUE(from->check("it"));
}

TEST(RosFields, UnknownRepresentationsAreNamed) {
  const std::string message("\0\7\0\0", 4);
  const auto opened = RosFields::open(MessageFormat::kCdr, bytes_of(message));
  ASSERT_FALSE(opened);
  EXPECT_THAT(opened.error().what, testing::HasSubstr("representation 7"));
}

}  // namespace
}  // namespace fiducap::ros
