#include "streaming/native/native.hpp"

#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>

#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::native {
namespace {

using testing::HasSubstr;

class NativeServerTest : public testing::Test {
 protected:
  NativeServerTest() { config_.port = 0; }
  auto start() { return start_native_server(io_, config_, frame_->model, clock_); }

  boost::asio::io_context io_;
  FakeClock clock_;
  NativeConfig config_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"a"});
};

TEST_F(NativeServerTest, ErrorsNameTheKeyToChange) {
  const auto first = start();
  ASSERT_TRUE(first) << first.error().text();
  config_.port = (*first)->port();
  const auto in_use = start();
  ASSERT_FALSE(in_use);
  EXPECT_EQ(in_use.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(in_use.error().text(), HasSubstr(std::to_string(config_.port)));
  EXPECT_THAT(in_use.error().text(), HasSubstr("streaming.native.port"));
  config_.address = "192.0.2.1";
  config_.port = 0;
  const auto foreign = start();
  ASSERT_FALSE(foreign);
  EXPECT_THAT(foreign.error().text(), HasSubstr("streaming.native.address"));
}

TEST_F(NativeServerTest, ReleasesItsPortWhenItStops) {
  auto first = start();
  ASSERT_TRUE(first);
  config_.port = (*first)->port();
  (*first)->stop();
  EXPECT_TRUE(start());
}

TEST_F(NativeServerTest, ListensOnIPv6) {
  config_.address = "::1";
  const auto server = start();
  if (!server && server.error().code == ErrorCode::kUnavailable) GTEST_SKIP() << "no IPv6 here";
  ASSERT_TRUE(server) << server.error().text();
  EXPECT_NE((*server)->port(), 0);
}

TEST_F(NativeServerTest, RefusesMoreBodiesThanTheProtocolCarries) {
  frame_ = make_scene_frame(std::vector<std::string>(1025, "x"));
  const auto server = start();
  ASSERT_FALSE(server);
  EXPECT_EQ(server.error().code, ErrorCode::kInvalid);
}

TEST_F(NativeServerTest, PublishesWithoutClientsAndMayEndBeforeItsIoContext) {
  {
    auto server = start();
    ASSERT_TRUE(server);
    (*server)->publish(frame_);
    std::vector<ClientStatus> clients;
    (*server)->append_clients(clients);
    EXPECT_TRUE(clients.empty());
  }
  EXPECT_NO_THROW(io_.poll());
}

TEST(NativeConfig, ReportsEveryBrokenRule) {
  NativeConfig config;
  EXPECT_TRUE(config.check().empty());
  config.address = "localhost";
  config.max_clients = 0;
  config.max_clients_per_address = -1;
  config.lease_s = 0;
  config.multicast_group = "10.0.0.1";
  config.multicast_port = 0;
  config.multicast_ttl = 256;
  config.multicast_interface = "eth0";
  EXPECT_EQ(config.check().size(), 8u);
  EXPECT_EQ(config.check()[0].path, "streaming.native.address");
}

}  // namespace
}  // namespace fiducap::native
