#include "streaming/native/native.hpp"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>

#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::native {
namespace {

class NativeServerTest : public testing::Test {
 protected:
  NativeServerTest() { config_.port = 0; }
  auto start() { return start_native_server(io_, config_, frame_->model, clock_); }

  boost::asio::io_context io_;
  FakeClock clock_;
  NativeConfig config_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"a"});
};

TEST_F(NativeServerTest, SaysWhatToDoWhenThePortIsInUse) {
  const auto first = start();
  ASSERT_TRUE(first) << first.error().text();
  config_.port = (*first)->port();
  const auto second = start();
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(second.error().text().find(std::to_string(config_.port)), std::string::npos)
      << second.error().text();
  EXPECT_NE(second.error().text().find("streaming.native.port"), std::string::npos)
      << second.error().text();
}

TEST_F(NativeServerTest, GivesThePortBackWhenItStops) {
  auto first = start();
  ASSERT_TRUE(first);
  config_.port = (*first)->port();
  (*first)->stop();
  EXPECT_TRUE(start());
}

TEST_F(NativeServerTest, SaysThatAnAddressIsNotOurs) {
  config_.address = "192.0.2.1";
  const auto server = start();
  ASSERT_FALSE(server);
  EXPECT_NE(server.error().text().find("streaming.native.address"), std::string::npos)
      << server.error().text();
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

TEST_F(NativeServerTest, PublishesWithoutClients) {
  auto server = start();
  ASSERT_TRUE(server);
  (*server)->publish(frame_);
  std::vector<ClientStatus> clients;
  (*server)->append_clients(clients);
  EXPECT_TRUE(clients.empty());
}

TEST_F(NativeServerTest, MayDieBeforeTheIoThreadIsDone) {
  {
    auto server = start();
    ASSERT_TRUE(server);
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
