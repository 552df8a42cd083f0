#include "streaming/vrpn/vrpn_config.hpp"

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
            "streaming.vrpn.address = localhost: must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all");
  EXPECT_EQ(errors[3].value, "[0, 0, 0, 1, -1, 1]");
}

}  // namespace
}  // namespace fiducap::vrpn
