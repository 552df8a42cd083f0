#include "streaming/dds/dds_config.hpp"

#include <gmock/gmock.h>

namespace fiducap::dds {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

TEST(DdsConfig, DefaultsAreFine) { EXPECT_THAT(DdsConfig{}.check(), IsEmpty()); }

TEST(DdsConfig, ReportsEveryBrokenRule) {
  DdsConfig config;
  config.prefix = "fiducap/";
  config.world_frame = "/world";
  config.poses_deadline_hz = 0.1;
  config.px4_rate_hz = 0;
  EXPECT_THAT(config.check(), SizeIs(4));
}

}  // namespace
}  // namespace fiducap::dds
