#include "streaming/vrpn/vrpn.hpp"

#include <gtest/gtest.h>

namespace fiducap::vrpn {
namespace {

TEST(VrpnConfig, DefaultsAreUsable) { EXPECT_TRUE(VrpnConfig{}.check().empty()); }

TEST(VrpnConfig, NamesEveryBrokenRuleAtOnce) {
  VrpnConfig config;
  config.address = "localhost";
  config.max_clients = 0;
  config.minor_version = 100;
  config.workspace_box_m = {0, 0, 0, 1, -1, 1};
  const auto errors = config.check();
  ASSERT_EQ(errors.size(), 4u);
  EXPECT_EQ(errors[0].text(),
            "streaming.vrpn.address = localhost: must be an IPv4 address, e.g. 127.0.0.1 or "
            "0.0.0.0 for all");
  EXPECT_EQ(errors[3].value, "[0, 0, 0, 1, -1, 1]");
}

TEST(VrpnConfig, SensorsBelongToBodiesAndAreFew) {
  VrpnConfig config;
  config.sensors = {{"arm", Pose{}}, {"drone", Pose{}}, {"arm", Pose{}}};
  EXPECT_TRUE(config.check().empty());
  EXPECT_EQ(config.sensors_of("arm").size(), 2u);
  EXPECT_TRUE(config.sensors_of("rover").empty());
  for (int i = 0; i < 3; ++i) config.sensors.push_back({"arm", Pose{}});
  config.sensors.push_back({"", Pose{}});
  config.sensors.push_back({"drone", {Eigen::Quaterniond(2, 0, 0, 0), Eigen::Vector3d::Zero()}});
  const auto errors = config.check();
  ASSERT_EQ(errors.size(), 7u);  // five of the arm, one without a body, one that is no attitude
  EXPECT_EQ(errors.back().path, "streaming.vrpn.sensors.7.X_PS");
}

}  // namespace
}  // namespace fiducap::vrpn
