#include <gmock/gmock.h>

#include <limits>
#include <random>

#include "middleware/network.hpp"
#include "streaming/dds/dds.hpp"
#include "streaming/dds/ros_messages.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::dds {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

SceneModel model_of(const std::vector<std::string>& names) {
  return *make_scene_frame(names)->model;
}

TEST(RosNames, AreValidRosNames) {
  EXPECT_THAT(ros_names(model_of({"drone", "cf_7"})), ElementsAre("drone", "cf_7"));
  EXPECT_THAT(ros_names(model_of({"drone", "arm"}), {{"drone", "cf 7"}}),
              ElementsAre("cf_7", "arm"))
      << "an alias";
  EXPECT_THAT(ros_names(model_of({"big-drone.v2", "7up", "_x__y_", "Größe 1", "日", "(+)"})),
              ElementsAre("big_drone_v2", "body_7up", "body_x_y", "Groesse_1", "u65e5", "body"));
  EXPECT_THAT(ros_names(model_of({"a-b", "a.b", "a_b"})), ElementsAre("a_b_2", "a_b_3", "a_b"))
      << "a valid name is kept";
  std::string longest;
  while (longest.size() + 2 <= 63) longest += "щ";
  EXPECT_TRUE(is_ros_name(ros_names(model_of({longest})).front()));
}

TEST(RosNames, AreValidAndDistinctForRandomNames) {
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    std::vector<std::string> names;
    for (int i = 0; i < 8; ++i) {
      std::string name;
      for (unsigned k = 0; k < random() % 6; ++k)
        name += static_cast<char>(random() % 3 == 0 ? random() % 256 : 'a');
      names.push_back(name);
    }
    auto given = ros_names(model_of(names));
    for (const auto& name : given) EXPECT_TRUE(is_ros_name(name)) << '"' << name << '"';
    std::sort(given.begin(), given.end());
    EXPECT_EQ(std::unique(given.begin(), given.end()), given.end());
  }
}

TEST(RosNames, NamespacesHaveALeadingSlashOnly) {
  EXPECT_TRUE(is_ros_namespace("/fiducap"));
  EXPECT_TRUE(is_ros_namespace("/lab/fiducap"));
  for (const char* bad : {"fiducap", "/", "/fiducap/", "//a", "/7", "/a b"})
    EXPECT_FALSE(is_ros_namespace(bad)) << bad;
}

constexpr double kRounding = 1e-12;

Eigen::Vector3d vector(const auto& message) { return {message.x, message.y, message.z}; }

class RosMessagesTest : public testing::Test {
 protected:
  RosMessagesTest() {
    body_.X_WP = {Eigen::Quaterniond(2 / 9., 4 / 9., 5 / 9., 6 / 9.), {1.0, -2.0, 0.25}};
    for (int row = 0; row < 12; ++row) {
      for (int column = 0; column < 12; ++column)
        body_.covariance(row, column) = 1 + std::min(row, column);
    }
  }
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"drone"});
  BodyPose body_ = frame_->bodies[0];
};

TEST_F(RosMessagesTest, QuaternionsEndWithTheirRealPart) {
  geometry_msgs_msg_dds__PoseStamped_ message{};
  fill(message, body_);
  const auto& [position, orientation] = message.pose;
  EXPECT_EQ(vector(position), Eigen::Vector3d(1.0, -2.0, 0.25));
  EXPECT_EQ(vector(orientation), Eigen::Vector3d(4 / 9., 5 / 9., 6 / 9.));
  EXPECT_EQ(orientation.w, 2 / 9.);
}

TEST_F(RosMessagesTest, TwistIsInTheWorldAndThatOfAnOdometryInTheBody) {
  geometry_msgs_msg_dds__TwistStamped_ world{};
  nav_msgs_msg_dds__Odometry_ own{};
  fill(world, body_);
  fill(own, body_);
  EXPECT_EQ(world.twist.linear.x, body_.v_WP.x());
  EXPECT_EQ(own.twist.twist.angular.z, body_.w_WP_P.z());
  EXPECT_TRUE((body_.X_WP.q * vector(own.twist.twist.linear)).isApprox(body_.v_WP, kRounding));
  EXPECT_TRUE(vector(world.twist.angular).isApprox(body_.X_WP.q * body_.w_WP_P, kRounding));
}

TEST_F(RosMessagesTest, CovariancesAreRowByRow) {
  body_.covariance(0, 1) = 77;  // not symmetric: shows the order
  nav_msgs_msg_dds__Odometry_ message{};
  fill(message, body_);
  EXPECT_EQ(message.pose.covariance[1], 77);
  EXPECT_EQ(message.pose.covariance[6], 1);
  EXPECT_EQ(message.pose.covariance[35], 6);
}

TEST_F(RosMessagesTest, Px4HasMicrosecondsItsAxesAndTheCounter) {
  px4_msgs_msg_dds__VehicleOdometry_ message{};
  fill(message, body_, 1'700'000'005'123'456'789, AutopilotWorld::kNed, 258);
  EXPECT_EQ(message.timestamp_sample, 1'700'000'005'123'456u);
  EXPECT_EQ(message.pose_frame, 1);
  EXPECT_FLOAT_EQ(message.position[0], -2.0F);
  EXPECT_FLOAT_EQ(message.position[1], 1.0F);
  EXPECT_FLOAT_EQ(message.position[2], -0.25F);
  EXPECT_FLOAT_EQ(message.angular_velocity[1], static_cast<float>(-body_.w_WP_P.y()));
  EXPECT_EQ(message.reset_counter, 2);  // a byte: wraps
}

TEST_F(RosMessagesTest, NativeHasTheExposureOfTheNewestImage) {
  fiducap_dds_Body message{};
  fill(message, body_, *frame_, 5);
  EXPECT_EQ(message.utc_ns, frame_->utc_ns());
  EXPECT_EQ(message.utc_ns - message.exposed_utc_ns, 20'000'000);
  EXPECT_EQ(message.attitude[0], 2 / 9.);
  EXPECT_EQ(message.covariance[143], 12);
  EXPECT_EQ(message.reset_counter, 5u);
  body_.exposed_at = {};
  fill(message, body_, *frame_, 5);
  EXPECT_EQ(message.exposed_utc_ns, 0);
}

TEST_F(RosMessagesTest, TimesBeforeTheEpochAreZero) {
  EXPECT_EQ(to_ros(std::int64_t{-1}).sec, 0);
  EXPECT_EQ(to_ros(std::int64_t{1'700'000'005'000'000'007}).sec, 1'700'000'005);
  EXPECT_EQ(to_ros(std::int64_t{1'700'000'005'000'000'007}).nanosec, 7u);
}

TEST_F(RosMessagesTest, InvalidBodiesAndNumbersAreNotUsable) {
  EXPECT_TRUE(is_usable(body_));
  body_.covariance(3, 3) = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(is_usable(body_));
  body_ = frame_->bodies[0];
  body_.valid = false;
  EXPECT_FALSE(is_usable(body_));
}

TEST(DdsConfig, ReportsEachInvalidValue) {
  DdsConfig config;
  EXPECT_THAT(config.check(), IsEmpty());
  config.prefix = "fiducap/";
  config.world_frame = "/world";
  config.poses_deadline_hz = 0.1;
  config.px4_rate_hz = 0;
  EXPECT_THAT(config.check(), SizeIs(4));
}

TEST(DdsNetwork, DefaultsToThisMachineWithoutMulticast) {
  const NetworkConfig config;
  EXPECT_THAT(config.check(), IsEmpty());
  EXPECT_FALSE(config.uses_multicast());
  AllowedSenders senders;
  senders.loopback_only = true;
  const std::string xml = cyclone_xml(config, senders);
  EXPECT_THAT(xml, HasSubstr("name=\"lo\" multicast=\"false\""));
  EXPECT_THAT(xml, HasSubstr("<AllowMulticast>false<"));
  EXPECT_THAT(xml, HasSubstr("<Peer Address=\"127.0.0.1\"/>"));
  EXPECT_THAT(xml, HasSubstr("<MaxSampleSize>" + std::to_string(kMaxMessage) + "B<"));
  EXPECT_THAT(xml, HasSubstr("<DontRoute>true<"));
  senders.attached_only = false;
  EXPECT_THAT(cyclone_xml(config, senders), HasSubstr("<DontRoute>false<")) << "a peer is beyond";
}

TEST(DdsNetwork, IsFoundByTheCardsOfThisMachineWithoutLeavingIt) {
  AllowedSenders senders;
  senders.loopback_only = true;
  senders.cards = {"10.0.0.5", "192.168.1.5"};
  const std::string xml = cyclone_xml({}, senders);
  for (const char* part :
       {"name=\"lo\" multicast=\"true\"", "address=\"10.0.0.5\"", "address=\"192.168.1.5\"",
        "<AllowMulticast>spdp<", "<MulticastTimeToLive>0<", "<Peer Address=\"127.0.0.1\"/>"})
    EXPECT_THAT(xml, HasSubstr(part));
}

TEST(DdsNetwork, LoopbackTakesNoPeersOfOtherMachines) {
  NetworkConfig config;
  config.peers = {"127.0.0.1"};
  EXPECT_THAT(config.check(), IsEmpty());
  config.peers = {"127.0.0.1", "192.168.1.7"};
  EXPECT_THAT(config.check(), SizeIs(1));
}

TEST(DdsNetwork, UsesMulticastOnOtherInterfacesWithoutPeers) {
  NetworkConfig config;
  config.interface = "eth0";
  EXPECT_TRUE(config.uses_multicast());
  EXPECT_THAT(cyclone_xml(config, {}), HasSubstr("<AllowMulticast>spdp<"));
  config.peers = {"192.168.1.7", "robot.local"};
  EXPECT_FALSE(config.uses_multicast());
  EXPECT_THAT(cyclone_xml(config, {}),
              HasSubstr("<Peer Address=\"192.168.1.7\"/><Peer Address=\"robot.local\"/>"));
  config.interface = "192.168.1.5";
  EXPECT_THAT(cyclone_xml(config, {}), HasSubstr("address=\"192.168.1.5\""));
}

TEST(DdsNetwork, RefusesCharactersThatEndAnAttribute) {
  NetworkConfig config;
  config.interface = "lo\"/><Evil x=\"";
  config.peers = {"a b", "<x>"};
  config.domain = 233;
  EXPECT_THAT(config.check(), SizeIs(4));
}

}  // namespace
}  // namespace fiducap::dds
