#include "capture/ros/ros_config.hpp"

#include <gmock/gmock.h>

namespace fiducap::dds {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

TEST(RosSourceConfig, ReportsEveryBrokenRule) {
  RosSourceConfig config;
  config.images = {"/cam0/image_raw", "/cam1/image_raw/compressed"};
  config.imu = "/imu/data";
  EXPECT_THAT(config.check("source."), IsEmpty());
  config.images = {"cam0/image_raw", "/cam 1", "/"};
  config.imu = "//imu";
  config.camera_info_wait_s = -1;
  EXPECT_THAT(config.check("source."), SizeIs(5));
  EXPECT_THAT(RosSourceConfig{}.check("source."), SizeIs(1)) << "no image topic";
}

}  // namespace
}  // namespace fiducap::dds
