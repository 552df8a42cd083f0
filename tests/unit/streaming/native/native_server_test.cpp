#include "streaming/native/native.hpp"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>

#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::native {
namespace {

TEST(NativeServer, ListensOnIPv6) {
  boost::asio::io_context io;
  FakeClock clock;
  NativeConfig config;
  config.port = 0;
  config.address = "::1";
  const auto server = serve({io, make_scene_frame({"a"})->model, clock}, config);
  if (!server && server.error().code == ErrorCode::kUnavailable) GTEST_SKIP() << "no IPv6 here";
  ASSERT_TRUE(server) << server.error().text();
  EXPECT_NE((*server)->port(), 0);
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
