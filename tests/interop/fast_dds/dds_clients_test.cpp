// Fast DDS of Debian subscribes to everything we offer: on loopback without multicast, and on
// another host. Both vendors' programs with their defaults, on a machine with a network card.
#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>

#include <chrono>
#include <optional>
#include <thread>

#include "middleware/participant.hpp"
#include "peer_process.hpp"
#include "streaming/dds/dds.hpp"
#include "support/fake_clock.hpp"
#include "support/network_namespace.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::dds {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const std::vector<std::string> kBodies{"drone", "rover"};
// Of five seconds at 100 Hz, of which the two sides need some to find each other.
constexpr int kEnough = 200;

class FastDdsClient : public testing::Test {
 protected:
  void open(const NetworkConfig& network, const DdsConfig& config) {
    auto participant = Participant::open(network);
    ASSERT_TRUE(participant) << participant.error().text();
    participant_ = *participant;
    auto server = serve({.io = io_,
                         .model = make_scene_frame(kBodies)->model,
                         .clock = clock_,
                         .join_dds = [this] { return participant_; }},
                        config);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  /// Publishes frames at 100 Hz; the bodies move, so that repeated messages would show.
  template <typename Condition>
  void publish_while(Condition condition) {
    auto due = std::chrono::steady_clock::now();
    while (condition()) {
      auto frame = make_scene_frame(kBodies, ++number_);
      frame->map = map_;
      server_->publish(frame);
      due += std::chrono::milliseconds(10);
      std::this_thread::sleep_until(due);
    }
  }
  std::map<std::string, Heard> hear(const DdsConfig& config,
                                    const std::vector<std::string>& topics) {
    NetworkConfig network;
    network.domain = 45;
    open(network, config);
    if (server_ == nullptr) return {};
    std::vector<std::string> arguments{"read", "45", "127.0.0.1", "127.0.0.1", "5"};
    arguments.insert(arguments.end(), topics.begin(), topics.end());
    PeerProcess peer(arguments);
    publish_while([&peer] { return peer.is_running(); });
    return peer.heard();
  }
  static std::shared_ptr<const TagMap> make_map() {
    auto map = std::make_shared<TagMap>();
    MapTag tag;
    tag.tag.tag_id = 7;
    tag.tag.edge_m = 0.2;
    tag.tag.X_WT = {Eigen::Quaterniond::Identity(), {3.0, 2.0, 1.0}};
    tag.state = TagState::kSurveyed;
    map->tags.push_back(tag);
    return map;
  }

  boost::asio::io_context io_;
  FakeClock clock_;
  std::shared_ptr<const TagMap> map_{make_map()};
  std::uint64_t number_{0};
  std::shared_ptr<Participant> participant_;
  std::unique_ptr<Streamer> server_;
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

TEST_F(FastDdsClient, ReliableReadersDoNotMatchBestEffortWriters) {
  DdsConfig config;
  config.reliable = false;
  auto heard =
      hear(config, {"PoseStamped:rt/drone/pose", "PoseStamped:rt/rover/pose:b", "TFMessage:rt/tf"});
  EXPECT_EQ(heard["rt/drone/pose"].count, 0);
  EXPECT_NE(heard["rt/drone/pose"].incompatible, 0);
  EXPECT_GE(heard["rt/rover/pose"].count, kEnough);
  EXPECT_GE(heard["rt/tf"].count, kEnough) << "tf2 always requests repeats";
}

// As in `./dev demo`: the server is on loopback, the readers use what their vendors choose.
TEST_F(FastDdsClient, BothVendorsDefaultsFindALoopbackServerBesideACard) {
  TwoHosts hosts;
  if (!hosts.problem.empty()) GTEST_SKIP() << hosts.problem;
  NetworkConfig network;
  network.domain = 46;
  hosts.server.on([&] { open(network, {}); });
  ASSERT_TRUE(server_);
  std::optional<PeerProcess> fast;
  std::optional<PeerProcess> cyclone;
  std::optional<PeerProcess> outside;
  hosts.server.on([&] {
    fast.emplace(
        std::vector<std::string>{"read", "46", "-", "-", "7", "PoseStamped:rt/drone/pose"});
    cyclone.emplace(std::vector<std::string>{"46", "7", "rt/drone/pose"}, CYCLONE_PEER);
  });
  hosts.client.on([&] {
    outside.emplace(std::vector<std::string>{"46", "7", "rt/drone/pose"}, CYCLONE_PEER);
  });
  publish_while(
      [&] { return fast->is_running() || cyclone->is_running() || outside->is_running(); });
  EXPECT_GE(fast->heard()["rt/drone/pose"].count, kEnough);
  EXPECT_GE(cyclone->heard()["rt/drone/pose"].count, kEnough);
  EXPECT_EQ(outside->heard()["rt/drone/pose"].count, 0) << "it is for this machine only";
  hosts.server.on([&] {
    server_.reset();
    participant_.reset();
  });
}

// Hosts joined by a cable on which multicast does not pass: only peers find each other. The cable
// disappears two seconds before our server ends: the server ends all the same.
TEST_F(FastDdsClient, FindsAServerOnAnotherHostWithoutMulticast) {
  TwoHosts hosts;
  if (!hosts.problem.empty()) GTEST_SKIP() << hosts.problem;
  for (auto* side : {&hosts.server, &hosts.client}) {
    ASSERT_TRUE(side->run("ip link set fdc0 multicast off").done);
    // Fast DDS reads the interfaces once, at its start; the kernel needs up to a second for the
    // link.
    ASSERT_TRUE(
        side->run("for i in $(seq 100); do ip link show fdc0 | grep -q 'state UP' && exit 0; "
                  "sleep 0.05; done; exit 1")
            .done);
  }
  NetworkConfig network;
  network.domain = 46;
  network.interface = TwoHosts::kServer;
  network.peers = {TwoHosts::kClient};
  hosts.server.on([&] { open(network, {}); });
  ASSERT_TRUE(server_);
  std::optional<PeerProcess> peer;
  hosts.client.on([&] {
    peer.emplace(std::vector<std::string>{"read", "46", TwoHosts::kClient, TwoHosts::kServer, "7",
                                          "PoseStamped:rt/drone/pose", "TFMessage:rt/tf_static:k",
                                          "Body:fiducap/bodies"});
  });
  publish_while([&peer] { return peer->is_running(); });
  auto heard = peer->heard();
  EXPECT_GE(heard["rt/drone/pose"].count, kEnough);
  EXPECT_THAT(heard["rt/drone/pose"].last, StartsWith("frame=world p=1,-2,0.5 "));
  EXPECT_EQ(heard["rt/tf_static"].count, 1);
  EXPECT_GE(heard["fiducap/bodies"].count, 2 * kEnough);
  EXPECT_TRUE(hosts.client.run("ip link delete fdc0").done);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  publish_while([end] { return std::chrono::steady_clock::now() < end; });
  hosts.server.on([&] {
    server_.reset();
    participant_.reset();
  });
}

}  // namespace
}  // namespace fiducap::dds
