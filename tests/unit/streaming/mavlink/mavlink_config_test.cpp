#include "streaming/mavlink/mavlink.hpp"

#include <gmock/gmock.h>

namespace fiducap::mavlink {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

TEST(MavlinkConfig, DefaultsAreFine) {
  MavlinkConfig config;
  config.vehicles.push_back({});
  config.vehicles[0].body = "drone";
  EXPECT_THAT(config.check(), IsEmpty());
}

TEST(MavlinkConfig, ReportsEveryBrokenRuleOfAVehicle) {
  MavlinkConfig config;
  VehicleConfig vehicle;
  vehicle.address = "px4.local";
  vehicle.port = 0;
  vehicle.rate_hz = 0;
  vehicle.system_id = 256;
  vehicle.component_id = 0;
  config.vehicles = {vehicle};
  EXPECT_THAT(config.check(), SizeIs(6));  // and no body
}

TEST(MavlinkConfig, TwoVehiclesNeedTwoAddresses) {
  MavlinkConfig config;
  VehicleConfig vehicle;
  vehicle.body = "drone";
  config.vehicles = {vehicle, vehicle};
  ASSERT_THAT(config.check(), SizeIs(1));
  EXPECT_EQ(config.check()[0].path, "streaming.mavlink.vehicles.1.port");
}

}  // namespace
}  // namespace fiducap::mavlink
