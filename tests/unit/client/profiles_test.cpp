// What a client asks for is what it gets: axes, rate, choice of bodies, multicast, discovery. Real
// loopback sockets.
#include <cmath>

#include "support/allocation_counter.hpp"
#include "test_server.hpp"

namespace fiducap {
namespace {

class ProfilesTest : public testing::Test {
 protected:
  ProfilesTest() { scene_->bodies[0].X_WP.p = {1, 2, 3}; }

  bool receives(const Client& client, TestServer& server, std::uint64_t frames = 1) {
    return publish_until(server, *scene_, [&] { return client.statistics().frames >= frames; }) &&
           client.latest(frame_);
  }

  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone", "arm", "cart"});
  Frame frame_;
};

TEST_F(ProfilesTest, TurnsTheAxes) {
  TestServer server(*scene_);
  auto options = options_for(server.port());
  options.up = WorldUp::kY;
  const Client client(options);
  ASSERT_TRUE(receives(client, server)) << client.statistics().problem;
  EXPECT_EQ(frame_.bodies[0].position_m, (std::array<double, 3>{1, 3, -2}));
  EXPECT_NE(server.clients()[0].detail.find("y-up m"), std::string::npos)
      << server.clients()[0].detail;
}

TEST_F(ProfilesTest, SendsTheBodiesThatWereChosenAlsoWhenOneAppearsLater) {
  TestServer server(*scene_);
  auto options = options_for(server.port());
  options.bodies = {"cart", "boat"};
  const Client client(options);
  ASSERT_TRUE(receives(client, server));
  ASSERT_EQ(frame_.bodies.size(), 1u);
  EXPECT_EQ(frame_.bodies[0].name, "cart");
  const auto number = scene_->number;
  scene_ = make_scene_frame({"boat", "drone", "cart"}, number);
  auto model = std::make_shared<SceneModel>(*scene_->model);
  model->generation = 2;
  scene_->model = model;
  ASSERT_TRUE(publish_until(server, *scene_,
                            [&] { return client.latest(frame_) && frame_.bodies.size() == 2; }));
  EXPECT_EQ(frame_.bodies[0].name, "boat");
  EXPECT_EQ(frame_.bodies[1].name, "cart");
}

TEST_F(ProfilesTest, LeavesFramesOutWithoutCallingThemLost) {
  TestServer server(*scene_);  // 100 Hz by its own account
  auto options = options_for(server.port());
  options.max_rate_hz = 30;  // every fourth
  const Client client(options);
  ASSERT_TRUE(receives(client, server, 20));
  EXPECT_EQ(frame_.number % 4, 0u);
  EXPECT_EQ(client.statistics().lost, 0u);
  const auto sent = server.clients()[0].frames_sent;
  EXPECT_GE(sent, 20u);
  EXPECT_LE(sent, scene_->number / 4 + 1);
}

TEST_F(ProfilesTest, LeavesTheCovarianceOut) {
  TestServer server(*scene_);
  auto options = options_for(server.port());
  options.covariance = false;
  const Client client(options);
  ASSERT_TRUE(receives(client, server));
  EXPECT_TRUE(std::isnan(frame_.bodies[0].pose_covariance[0]));
  EXPECT_NEAR(frame_.bodies[0].position_sigma_m, 0.01, 1e-6);
  EXPECT_NEAR(frame_.bodies[0].velocity_sigma_m_s, 0.01, 1e-6);
}

TEST_F(ProfilesTest, ServesManyDifferentClientsAtOnce) {
  TestServer server(*scene_);
  std::vector<std::unique_ptr<Client>> clients;
  for (int i = 0; i < 12; ++i) {
    auto options = options_for(server.port());
    options.up = i % 2 == 0 ? WorldUp::kZ : WorldUp::kY;
    options.bodies = i % 3 == 0 ? std::vector<std::string>{} : std::vector<std::string>{"arm"};
    clients.push_back(std::make_unique<Client>(options));
  }
  ASSERT_TRUE(publish_until(server, *scene_, [&] {
    return std::all_of(clients.begin(), clients.end(),
                       [](auto& c) { return c->statistics().frames > 10; });
  }));
  for (std::size_t i = 0; i < clients.size(); ++i) {
    ASSERT_TRUE(clients[i]->latest(frame_));
    EXPECT_EQ(frame_.bodies.size(), i % 3 == 0 ? 3u : 1u);
    EXPECT_EQ(clients[i]->statistics().lost, 0u);
  }
}

TEST_F(ProfilesTest, SaysThatTheServerEncodesEnoughProfiles) {
  native::NativeConfig config;
  config.max_clients_per_address = 32;
  TestServer server(*scene_, 0, config);
  std::vector<std::unique_ptr<Client>> clients;
  for (int i = 1; i <= 16; ++i) {
    auto options = options_for(server.port());
    options.max_rate_hz = i;
    clients.push_back(std::make_unique<Client>(options));
    ASSERT_TRUE(wait_until([&] { return clients.back()->statistics().connected; }));
  }
  auto options = options_for(server.port());
  options.max_rate_hz = 17;
  const Client one_too_many(options);
  EXPECT_TRUE(wait_until([&] {
    return one_too_many.statistics().problem.find("profiles") != std::string::npos;
  })) << one_too_many.statistics().problem;
  clients.pop_back();
  EXPECT_TRUE(wait_until([&] { return one_too_many.statistics().connected; }))
      << one_too_many.statistics().problem;
}

TEST_F(ProfilesTest, RefusesNamesThatNoDatagramHolds) {
  ClientOptions options;
  options.bodies.assign(33, "x");
  EXPECT_THROW(Client{options}, std::invalid_argument);
  options.bodies.assign(1, std::string(129, 'x'));
  EXPECT_THROW(Client{options}, std::invalid_argument);
}

TEST_F(ProfilesTest, SendsMulticastOnceForAllWhoWantIt) {
  native::NativeConfig config;
  config.multicast_group = "239.255.42.16";
  config.multicast_port = 24581;
  TestServer server(*scene_, 0, config);
  auto options = options_for(server.port());
  options.multicast = true;
  const Client first(options);
  const Client second(options);
  const Client alone(options_for(server.port()));
  if (!publish_until(server, *scene_, [&] {
        return first.statistics().frames > 20 && second.statistics().frames > 20 &&
               alone.statistics().frames > 20;
      })) {
    FAIL() << first.statistics().problem;
  }
  if (!first.statistics().multicast)
    GTEST_SKIP() << "multicast does not come back on this machine's loopback";
  EXPECT_TRUE(second.statistics().multicast);
  EXPECT_FALSE(alone.statistics().multicast);
  EXPECT_EQ(first.statistics().lost, 0u);
}

TEST_F(ProfilesTest, FallsBackToUnicastWhereTheGroupIsSilent) {
  native::NativeConfig config;
  config.multicast_group = "239.255.42.16";
  config.multicast_port = 24582;
  config.multicast_ttl = 0;
  TestServer server(*scene_, 0, config);
  auto options = options_for(server.port());
  options.multicast = true;
  // A stranger holds the port without sharing it: the client cannot join.
  const int taken = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in any{};
  any.sin_family = AF_INET;
  any.sin_port = htons(24582);
  ASSERT_EQ(::bind(taken, reinterpret_cast<sockaddr*>(&any), sizeof(any)), 0);
  const Client client(options);
  EXPECT_TRUE(receives(client, server));
  EXPECT_FALSE(client.statistics().multicast);
  ::close(taken);
}

TEST_F(ProfilesTest, IsDiscovered) {
  TestServer server(*scene_);
  scene_->number = 1;
  server.publish(scene_);
  const auto found = Client::discover(std::chrono::milliseconds(300), server.port());
  ASSERT_EQ(found.size(), 1u) << "once, however often it was asked";
  EXPECT_EQ(found[0].address, "127.0.0.1");
  EXPECT_EQ(found[0].port, server.port());
  EXPECT_EQ(found[0].bodies, 3);
  EXPECT_EQ(found[0].rate_hz, 100);
  EXPECT_FALSE(found[0].host.empty());
  EXPECT_FALSE(found[0].version.empty());
}

TEST_F(ProfilesTest, IsNotDiscoveredWhenItShallNotBe) {
  native::NativeConfig config;
  config.discovery = false;
  TestServer server(*scene_, 0, config);
  EXPECT_TRUE(Client::discover(std::chrono::milliseconds(200), server.port()).empty());
}

}  // namespace
}  // namespace fiducap
