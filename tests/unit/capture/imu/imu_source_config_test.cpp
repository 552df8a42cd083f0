#include "capture/imu/imu_source_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

namespace fiducap {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// Path → rule of everything that is wrong.
std::map<std::string, std::string> faults_of(const ImuSourceConfig& config) {
  std::map<std::string, std::string> faults;
  for (const ConfigError& error : config.check("imu_source.")) faults[error.path] = error.rule;
  return faults;
}

ImuSourceConfig serial_line() {
  ImuSourceConfig config;
  config.line.device = "/dev/ttyACM0";
  return config;
}

TEST(ImuSourceConfig, ALineNeedsADeviceOrAPort) {
  EXPECT_THAT(faults_of(serial_line()), IsEmpty());
  ImuSourceConfig config;
  EXPECT_THAT(faults_of(config)["imu_source.port"], HasSubstr("must be the UDP port"));
  config.line.port = 5005;
  EXPECT_THAT(faults_of(config), IsEmpty());
  config.line.device = "/dev/ttyUSB0";
  EXPECT_THAT(faults_of(config)["imu_source.port"], HasSubstr("not be given together"));
}

TEST(ImuSourceConfig, AddressesAreAddresses) {
  ImuSourceConfig config;
  config.line.port = 5005;
  config.line.address = "here";
  config.line.peer = "10.0.0.2:port";
  config.line.baud = 10;
  EXPECT_EQ(faults_of(config).size(), 3u);
  config = serial_line();
  config.line.device = "ttyACM0";
  EXPECT_TRUE(faults_of(config).contains("imu_source.device"));
}

TEST(ImuSourceConfig, MavlinkMayCallTheVehicleFromAnyPort) {
  ImuSourceConfig config;
  config.type = ImuSourceType::kMavlink;
  config.mavlink.link.peer = "127.0.0.1:14580";
  EXPECT_THAT(faults_of(config), IsEmpty());
  config.mavlink.link.peer = "127.0.0.1";
  EXPECT_TRUE(faults_of(config).contains("imu_source.port"));
}

TEST(ImuSourceConfig, ARateThatASerialLineCannotCarryIsRefused) {
  ImuSourceConfig config;
  config.type = ImuSourceType::kMavlink;
  config.mavlink.link.device = "/dev/ttyS0";
  EXPECT_THAT(faults_of(config), IsEmpty());
  config.mavlink.link.baud = 57600;
  EXPECT_THAT(faults_of(config)["imu_source.rate_hz"], HasSubstr("needs 80000 baud"));
  config.mavlink.link.device = "/dev/ttyACM0";
  EXPECT_THAT(faults_of(config), IsEmpty()) << "USB is not bound by it";
}

TEST(ImuSourceConfig, AutopilotsAreNotTurnedTwice) {
  ImuSourceConfig config = serial_line();
  const std::vector<std::string> frd{"frd"};
  config.axes = *axes_from(frd);
  EXPECT_THAT(faults_of(config), IsEmpty());
  config.type = ImuSourceType::kPx4;
  EXPECT_THAT(faults_of(config)["imu_source.axes"], HasSubstr("[x, -y, -z]"));
}

TEST(ImuSourceConfig, TopicsAndDevicesAreChecked) {
  ImuSourceConfig config;
  config.type = ImuSourceType::kRos;
  config.ros.topic = "imu";
  EXPECT_TRUE(faults_of(config).contains("imu_source.topic"));
  config.type = ImuSourceType::kIio;
  config.iio.uri = "10.0.0.1";
  config.iio.samples = 0;
  EXPECT_EQ(faults_of(config).size(), 2u);
}

TEST(ImuUnits, AreScaledToSi) {
  const ImuUnits units{GyroUnit::kDegrees, AccelUnit::kG};
  EXPECT_DOUBLE_EQ(180 * units.gyro_scale(), 3.141592653589793);
  EXPECT_DOUBLE_EQ(units.accel_scale(), 9.80665);
}

}  // namespace
}  // namespace fiducap
