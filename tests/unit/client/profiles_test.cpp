// Each client gets what it requests: axes, rate, bodies, multicast, discovery. Over real loopback
// sockets.
#include <gmock/gmock.h>

#include <cmath>

#include "support/loopback_socket.hpp"
#include "unit/client/test_server.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::Field;

class ProfilesTest : public ClientServerTest {
 protected:
  ProfilesTest() {
    scene_ = make_scene_frame({"drone", "arm", "cart"});
    scene_->bodies[0].X_WP.p = {1, 2, 3};
  }
  Client& add_client(const std::function<void(ClientOptions&)>& change) {
    ClientOptions changed = options();
    change(changed);
    return *clients_.emplace_back(std::make_unique<Client>(changed));
  }
  std::vector<std::unique_ptr<Client>> clients_;
};

TEST_F(ProfilesTest, TransformsTheAxesAndOmitsTheCovariance) {
  connect([](ClientOptions& options) {
    options.up = WorldUp::kY;
    options.covariance = false;
  });
  EXPECT_THAT(frame_.bodies[0].position_m, ElementsAre(1, 3, -2));
  EXPECT_THAT(server_->clients()[0].detail, testing::HasSubstr("y-up m"));
  EXPECT_TRUE(std::isnan(frame_.bodies[0].pose_covariance[0]));
  EXPECT_NEAR(frame_.bodies[0].position_sigma_m, 0.01, 1e-6);
  EXPECT_NEAR(frame_.bodies[0].velocity_sigma_m_s, 0.01, 1e-6);
}

TEST_F(ProfilesTest, SendsRequestedBodiesAlsoNewOnes) {
  connect([](ClientOptions& options) { options.bodies = {"cart", "boat"}; });
  EXPECT_THAT(frame_.bodies, ElementsAre(Field(&Body::name, "cart")));
  scene_ = make_scene_frame({"boat", "drone", "cart"}, scene_->number);
  auto model = std::make_shared<SceneModel>(*scene_->model);
  model->generation = 2;
  scene_->model = model;
  ASSERT_TRUE(publish_until([&] { return client_->latest(frame_) && frame_.bodies.size() == 2; }));
  EXPECT_THAT(frame_.bodies, ElementsAre(Field(&Body::name, "boat"), Field(&Body::name, "cart")));
}

TEST_F(ProfilesTest, FramesLeftOutAreNotLost) {
  // The server's rate is 100 Hz: every fourth frame.
  connect([](ClientOptions& options) { options.max_rate_hz = 30; });
  ASSERT_TRUE(publish_until([&] { return statistics().frames >= 20; }));
  ASSERT_TRUE(client_->latest(frame_));
  EXPECT_EQ(frame_.number % 4, 0u);
  EXPECT_EQ(statistics().lost, 0u);
  const auto sent = server_->clients()[0].frames_sent;
  EXPECT_GE(sent, 20u);
  EXPECT_LE(sent, scene_->number / 4 + 1);
}

TEST_F(ProfilesTest, ServesManyProfilesAtOnce) {
  start();
  for (int i = 0; i < 12; ++i)
    add_client([i](ClientOptions& options) {
      options.up = i % 2 == 0 ? WorldUp::kZ : WorldUp::kY;
      if (i % 3 != 0) options.bodies = {"arm"};
    });
  ASSERT_TRUE(publish_until([&] {
    return std::all_of(clients_.begin(), clients_.end(),
                       [](auto& c) { return c->statistics().frames > 10; });
  }));
  for (std::size_t i = 0; i < clients_.size(); ++i) {
    ASSERT_TRUE(clients_[i]->latest(frame_));
    EXPECT_EQ(frame_.bodies.size(), i % 3 == 0 ? 3u : 1u);
    EXPECT_EQ(clients_[i]->statistics().lost, 0u);
  }
}

TEST_F(ProfilesTest, RefusesMoreProfilesThanItEncodes) {
  native::NativeConfig config;
  config.max_clients_per_address = 32;
  start(config);
  const auto add = [&](int rate_hz) -> Client& {
    return add_client([=](ClientOptions& options) { options.max_rate_hz = rate_hz; });
  };
  for (int i = 1; i <= 16; ++i) {
    const Client& client = add(i);
    ASSERT_TRUE(wait_until([&] { return client.statistics().connected; }));
  }
  const Client& refused = add(17);
  EXPECT_TRUE(wait_until([&] {
    return refused.statistics().problem.find("profiles") != std::string::npos;
  })) << refused.statistics().problem;
  clients_.erase(clients_.begin() + 15);
  EXPECT_TRUE(wait_until([&] { return refused.statistics().connected; }))
      << refused.statistics().problem;
}

TEST_F(ProfilesTest, RefusesNamesThatExceedADatagram) {
  ClientOptions options;
  options.bodies.assign(33, "x");
  EXPECT_THROW(Client{options}, std::invalid_argument);
  options.bodies.assign(1, std::string(129, 'x'));
  EXPECT_THROW(Client{options}, std::invalid_argument);
}

native::NativeConfig with_multicast(std::uint16_t port) {
  native::NativeConfig config;
  config.multicast_group = "239.255.42.16";
  config.multicast_port = port;
  return config;
}

TEST_F(ProfilesTest, SendsMulticastOnceToAllSubscribers) {
  start(with_multicast(24581));
  const auto multicast = [](ClientOptions& options) { options.multicast = true; };
  const Client& first = add_client(multicast);
  const Client& second = add_client(multicast);
  const Client& unicast = add_client([](ClientOptions&) {});
  ASSERT_TRUE(publish_until([&] {
    return first.statistics().frames > 20 && second.statistics().frames > 20 &&
           unicast.statistics().frames > 20;
  })) << first.statistics().problem;
  if (!first.statistics().multicast)
    GTEST_SKIP() << "multicast does not come back on this machine's loopback";
  EXPECT_TRUE(second.statistics().multicast);
  EXPECT_FALSE(unicast.statistics().multicast);
  EXPECT_EQ(first.statistics().lost, 0u);
}

TEST_F(ProfilesTest, FallsBackToUnicastWithoutMulticast) {
  auto config = with_multicast(24582);
  config.multicast_ttl = 0;
  start(config);
  // Another socket has the port without sharing it: the client cannot join.
  const int taken = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in any = loopback(24582);
  any.sin_addr.s_addr = htonl(INADDR_ANY);
  ASSERT_EQ(::bind(taken, reinterpret_cast<const sockaddr*>(&any), sizeof(any)), 0);
  connect([](ClientOptions& options) { options.multicast = true; });
  EXPECT_FALSE(statistics().multicast);
  ::close(taken);
}

TEST_F(ProfilesTest, ServerIsDiscoveredUnlessConfiguredNotToBe) {
  start();
  scene_->number = 1;
  server_->publish(scene_);
  const auto found = Client::discover(std::chrono::milliseconds(300), server_->port());
  ASSERT_EQ(found.size(), 1u) << "once, for any number of requests";
  EXPECT_EQ(found[0].address, "127.0.0.1");
  EXPECT_EQ(found[0].port, server_->port());
  EXPECT_EQ(found[0].bodies, 3);
  EXPECT_EQ(found[0].rate_hz, 100);
  EXPECT_FALSE(found[0].host.empty());
  EXPECT_FALSE(found[0].version.empty());
  native::NativeConfig config;
  config.discovery = false;
  start(config);
  EXPECT_TRUE(Client::discover(std::chrono::milliseconds(200), server_->port()).empty());
}

}  // namespace
}  // namespace fiducap
