#include "streaming/vicon/vicon.hpp"

#include <gtest/gtest.h>

namespace fiducap::vicon {
namespace {

TEST(ViconConfig, DefaultsAreFit) {
  EXPECT_TRUE(ViconConfig{}.check().empty());
  EXPECT_EQ(ViconConfig{}.port, 801);
  EXPECT_EQ(ViconConfig{}.when_invalid, WhenInvalid::kFlag);
}

TEST(ViconConfig, NamesEveryBrokenRule) {
  ViconConfig config;
  config.address = "localhost";
  config.max_clients = 0;
  config.max_clients_per_address = 1000;
  const auto errors = config.check();
  ASSERT_EQ(errors.size(), 3u);
  EXPECT_EQ(errors[0].path, "streaming.vicon.address");
  EXPECT_EQ(errors[1].path, "streaming.vicon.max_clients");
  EXPECT_EQ(errors[2].path, "streaming.vicon.max_clients_per_address");
}

}  // namespace
}  // namespace fiducap::vicon
