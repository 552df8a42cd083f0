#include "streaming/net/bind.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap::net {
namespace {

using testing::HasSubstr;

constexpr std::string_view kKey = "streaming.test";

TEST(Bind, AnyFreePortIsFound) {
  boost::asio::io_context io;
  const auto udp = bind_udp(io, {"127.0.0.1", 0, kKey});
  const auto tcp = listen_tcp(io, {"127.0.0.1", 0, kKey});
  ASSERT_TRUE(udp && tcp);
  EXPECT_GT(udp->local_endpoint().port(), 0);
  EXPECT_GT(tcp->local_endpoint().port(), 0);
}

TEST(Bind, APortInUseNamesWhoToAskAndWhichKeyToChange) {
  boost::asio::io_context io;
  const auto first = bind_udp(io, {"127.0.0.1", 0, kKey});
  ASSERT_TRUE(first);
  const auto port = first->local_endpoint().port();
  const auto second = bind_udp(io, {"127.0.0.1", port, kKey, "data_port"});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text(), HasSubstr("ss -tulpn | grep " + std::to_string(port)));
  EXPECT_THAT(second.error().text(), HasSubstr("streaming.test.data_port"));
}

TEST(Bind, AnAddressOfAnotherMachineNamesTheRemedy) {
  boost::asio::io_context io;
  const auto tcp = listen_tcp(io, {"192.0.2.1", 0, kKey});
  ASSERT_FALSE(tcp);
  EXPECT_THAT(tcp.error().text(), HasSubstr("no interface with the address 192.0.2.1"));
}

TEST(Bind, AWordIsNoAddress) {
  boost::asio::io_context io;
  const auto udp = bind_udp(io, {"localhost", 0, kKey});
  ASSERT_FALSE(udp);
  EXPECT_EQ(udp.error().code, ErrorCode::kInvalid);
  EXPECT_THAT(udp.error().text(), HasSubstr("streaming.test.address"));
}

TEST(Bind, ALowPortWithoutPermissionNamesAllWaysOut) {
  const auto denied = boost::system::errc::make_error_code(boost::system::errc::permission_denied);
  const std::string text = bind_remedy(denied, {"0.0.0.0", 801, "streaming.vicon"});
  EXPECT_THAT(text, HasSubstr("setcap cap_net_bind_service"));
  EXPECT_THAT(text, HasSubstr("ip_unprivileged_port_start=801"));
  EXPECT_THAT(text, HasSubstr("streaming.vicon.port"));
}

}  // namespace
}  // namespace fiducap::net
