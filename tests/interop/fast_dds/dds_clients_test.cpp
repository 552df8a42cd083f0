// Fast DDS of Debian subscribes to everything we offer, on loopback, without multicast.
#include <gmock/gmock.h>

#include "peer_process.hpp"
#include "streaming/dds/dds.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::dds {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr int kDomain = 45;
const std::vector<std::string> kBodies{"drone", "rover"};
// Five seconds at 100 Hz, of which the two sides need some to find each other.
constexpr const char* kSeconds = "5";
constexpr int kEnough = 200;

class FastDdsClient : public testing::Test {
 protected:
  std::map<std::string, Heard> hear(const DdsConfig& config, std::vector<std::string> topics) {
    NetworkConfig network;
    network.domain = kDomain;
    auto participant = Participant::open(network);
    if (!participant) {
      ADD_FAILURE() << participant.error().text();
      return {};
    }
    auto server = start_dds_server([&participant] { return participant; }, config,
                                   make_scene_frame(kBodies)->model, clock_);
    if (!server) {
      ADD_FAILURE() << server.error().text();
      return {};
    }
    std::vector<std::string> arguments{"read", std::to_string(kDomain), "127.0.0.1", "127.0.0.1",
                                       kSeconds};
    arguments.insert(arguments.end(), topics.begin(), topics.end());
    PeerProcess peer(arguments);
    publish_frames(**server, kBodies, [&peer] { return peer.is_running(); });
    return peer.heard();
  }
  FakeClock clock_;
};

TEST_F(FastDdsClient, ReadsEveryTopicWithTheQosThatItsSubscribersUse) {
  DdsConfig config;
  config.px4 = Px4Profile::kFrd;
  auto heard = hear(config, {"PoseStamped:rt/drone/pose", "TwistStamped:rt/drone/twist:b",
                             "Odometry:rt/rover/odom", "TFMessage:rt/tf",
                             "TFMessage:rt/tf_static:k", "NamedPoseArray:rt/poses:bd",
                             "RigidBodies:rt/rigid_bodies:b", "DiagnosticArray:rt/diagnostics",
                             "VehicleOdometry:rt/drone/fmu/in/vehicle_visual_odometry:b",
                             "Body:fiducap/bodies", "Tag:fiducap/tags:k"});
  for (const auto& [topic, about] : heard) EXPECT_EQ(about.incompatible, 0) << topic;
  EXPECT_GE(heard["rt/drone/pose"].count, kEnough);
  EXPECT_THAT(heard["rt/drone/pose"].last, StartsWith("frame=world p=1,-2,0.5 q_xyzw="));
  EXPECT_GE(heard["rt/drone/twist"].count, kEnough);
  EXPECT_THAT(heard["rt/drone/twist"].last, StartsWith("frame=world v=0.5,-0.25,0.125 w="));
  EXPECT_GE(heard["rt/rover/odom"].count, kEnough);
  EXPECT_THAT(heard["rt/rover/odom"].last, HasSubstr("child=rover p=2,-2,0.5"));
  EXPECT_THAT(heard["rt/rover/odom"].last,
              HasSubstr(" w=0.1,0.2,0.3 pose_cov=0.0001,0,0,0,0,0,0,0.0001,"));
  EXPECT_GE(heard["rt/tf"].count, kEnough);
  EXPECT_EQ(heard["rt/tf"].last, "transforms=2 world>drone@1,-2,0.5 world>rover@2,-2,0.5");
  EXPECT_EQ(heard["rt/tf_static"].count, 1);
  EXPECT_EQ(heard["rt/tf_static"].last, "transforms=1 world>tag_7@3,2,1");
  EXPECT_GE(heard["rt/poses"].count, kEnough);
  EXPECT_THAT(heard["rt/poses"].last, HasSubstr(" rover p=2,-2,0.5"));
  EXPECT_GE(heard["rt/rigid_bodies"].count, kEnough);
  EXPECT_GE(heard["rt/diagnostics"].count, 2);
  EXPECT_THAT(heard["rt/diagnostics"].last,
              HasSubstr("[fiducap: drone|0|tracking|position sigma (m)=0.0100|"));
  EXPECT_GE(heard["rt/drone/fmu/in/vehicle_visual_odometry"].count, kEnough / 2);
  EXPECT_THAT(heard["rt/drone/fmu/in/vehicle_visual_odometry"].last,
              StartsWith("frame=2 p=1,2,-0.5 "));
  EXPECT_GE(heard["fiducap/bodies"].count, 2 * kEnough);
  EXPECT_EQ(heard["fiducap/bodies"].ids, 2);
  EXPECT_EQ(heard["fiducap/tags"].count, 1);
}

TEST_F(FastDdsClient, WhoNeedsRepeatsIsNotServedByABestEffortWriter) {
  DdsConfig config;
  config.reliable = false;
  auto heard =
      hear(config, {"PoseStamped:rt/drone/pose", "PoseStamped:rt/rover/pose:b", "TFMessage:rt/tf"});
  EXPECT_EQ(heard["rt/drone/pose"].count, 0);
  EXPECT_NE(heard["rt/drone/pose"].incompatible, 0);
  EXPECT_GE(heard["rt/rover/pose"].count, kEnough);
  EXPECT_GE(heard["rt/tf"].count, kEnough) << "tf2 always asks for repeats";
}

}  // namespace
}  // namespace fiducap::dds
