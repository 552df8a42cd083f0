#include "capture/imu/imu_source_config.hpp"

#include <gmock/gmock.h>
#include <yaml-cpp/yaml.h>

#include <map>
#include <vector>

#include "capture/ros/ros_config.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

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

TEST(ImuSourceConfig, NeedsADeviceOrAPort) {
  EXPECT_THAT(faults_of(serial_line()), IsEmpty());
  ImuSourceConfig config;
  EXPECT_THAT(faults_of(config)["imu_source.port"], HasSubstr("must be the UDP port"));
  config.line.port = 5005;
  EXPECT_THAT(faults_of(config), IsEmpty());
  config.line.device = "/dev/ttyUSB0";
  EXPECT_THAT(faults_of(config)["imu_source.port"], HasSubstr("not be given together"));
}

TEST(ImuSourceConfig, RefusesInvalidAddresses) {
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

TEST(ImuSourceConfig, ChecksMavlinkLinks) {
  ImuSourceConfig config;
  config.type = ImuSourceType::kMavlink;
  config.mavlink.link.peer = "127.0.0.1:14580";
  EXPECT_THAT(faults_of(config), IsEmpty()) << "from any port";
  config.mavlink.link.peer = "127.0.0.1";
  EXPECT_TRUE(faults_of(config).contains("imu_source.port"));
  config.mavlink = {};
  config.mavlink.link.device = "/dev/ttyS0";
  EXPECT_THAT(faults_of(config), IsEmpty());
  config.mavlink.link.baud = 57600;
  EXPECT_THAT(faults_of(config)["imu_source.rate_hz"], HasSubstr("needs 80000 baud"));
  config.mavlink.link.device = "/dev/ttyACM0";
  EXPECT_THAT(faults_of(config), IsEmpty()) << "USB has no baud rate";
}

TEST(ImuSourceConfig, RefusesAxesForPx4) {
  ImuSourceConfig config = serial_line();
  config.axes = *axes_from(std::vector<std::string>{"frd"});
  EXPECT_THAT(faults_of(config), IsEmpty());
  config.type = ImuSourceType::kPx4;
  EXPECT_THAT(faults_of(config)["imu_source.axes"], HasSubstr("[x, -y, -z]"));
}

TEST(ImuSourceConfig, ChecksTopicsAndDevices) {
  ImuSourceConfig config;
  config.type = ImuSourceType::kRos;
  config.ros.topic = "imu";
  EXPECT_TRUE(faults_of(config).contains("imu_source.topic"));
  config.type = ImuSourceType::kIio;
  config.iio.uri = "10.0.0.1";
  config.iio.samples = 0;
  EXPECT_EQ(faults_of(config).size(), 2u);
}

TEST(RosSourceConfig, ReportsEveryBrokenRule) {
  dds::RosSourceConfig config;
  config.images = {"/cam0/image_raw", "/cam1/image_raw/compressed"};
  config.imu = "/imu/data";
  EXPECT_THAT(config.check("source."), IsEmpty());
  config.images = {"cam0/image_raw", "/cam 1", "/"};
  config.imu = "//imu";
  config.camera_info_wait_s = -1;
  EXPECT_THAT(config.check("source."), SizeIs(5));
  EXPECT_THAT(dds::RosSourceConfig{}.check("source."), SizeIs(1)) << "no image topic";
}

constexpr double kRounding = 1e-12;

ImuAxes read(const std::string& yaml) {
  ImuAxes axes;
  EXPECT_EQ(read_value(YAML::Load(yaml), axes), std::nullopt) << yaml;
  return axes;
}

std::optional<std::string> fault_of(const std::string& yaml) {
  ImuAxes axes;
  const auto fault = read_value(YAML::Load(yaml), axes);
  EXPECT_EQ(axes.R_BS, Eigen::Matrix3d::Identity()) << "nothing is half read";
  return fault;
}

TEST(ImuAxes, AreThoseOfTheBodyByDefault) {
  EXPECT_FALSE(ImuAxes{}.is_turned());
  EXPECT_FALSE(read("flu").is_turned());
  EXPECT_FALSE(read("[x, y, z]").is_turned());
}

TEST(ImuAxes, RotateReadingsIntoTheBody) {
  const struct {
    const char* axes;
    Eigen::Vector3d reading, in_body;
  } kCases[] = {{"frd", {0, 0, -9.81}, {0, 0, 9.81}},  // at rest: specific force points upwards
                {"camera", {0, 0, 1}, {1, 0, 0}},      // forward
                {"camera", {-1, 0, 0}, {0, 1, 0}},     // left
                {"camera", {0, -1, 0}, {0, 0, 1}},     // up
                {"[y, -x, z]", {1, 2, 3}, {2, -1, 3}}, {"[-z, +y, x]", {1, 2, 3}, {-3, 2, 1}}};
  for (const auto& [axes, reading, in_body] : kCases)
    EXPECT_EQ(read(axes).R_BS * reading, in_body) << axes;
}

TEST(ImuAxes, MayBeAQuaternion) {
  // A quarter turn about z: the unit's x points to the left.
  const Eigen::Matrix3d R_BS = read("[0.70711, 0, 0, 0.70711]").R_BS;
  EXPECT_NEAR((R_BS * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 1, 0)).norm(), 0, kRounding);
  EXPECT_NEAR(R_BS.determinant(), 1, kRounding);
}

TEST(ImuAxes, RefuseMirroredDoubledAndUnknownAxes) {
  for (const char* wrong :
       {"[y, x, z]", "[x, y, -z]", "[x, x, z]", "[x, y]", "[x, y, w]", "[x, y, zz]", "ned",
        "[1, 0, 0, 1]", "[a, 0, 0, 1]", "{x: y}", "[]", "[x, [y], z]", "[nan, 0, 0, 0]"}) {
    const auto fault = fault_of(wrong).value();
    EXPECT_NE(fault.find("right-handed"), std::string::npos);
  }
}

TEST(ImuAxes, ArePrintedAsTheyWereWritten) {
  for (const char* text : {"flu", "camera", "[y, -x, z]", "[0, 1, 0, 0]"})
    EXPECT_EQ(text_of(read(text)), text);
}

}  // namespace
}  // namespace fiducap
