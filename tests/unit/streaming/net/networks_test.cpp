#include "middleware/net/networks.hpp"

#include <gmock/gmock.h>

#include "middleware/net/peer.hpp"
#include "streaming/net/bind.hpp"

namespace fiducap::net {
namespace {

using testing::HasSubstr;

TEST(Peer, WrittenAddressIsReadBack) {
  const Peer peer{0x0a4d0107, 1511};
  EXPECT_EQ(text_of(peer), "10.77.1.7:1511");
  EXPECT_EQ(parse_peer("10.77.1.7:1511"), peer);
  EXPECT_EQ(peer.ipv4(), 0x0a4d0107u);
  for (const char* text :
       {"", ":", "10.0.0.1", "10.0.0.1:", "10.0.0.1:x", "10.0.0.1:65536", "10.0.0:1", "1.2.3.4:5 "})
    EXPECT_EQ(parse_peer(text), std::nullopt) << text;
  const Peer v6({0x20, 0x01, 0x0d, 0xb8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7}, 80);
  EXPECT_EQ(text_of(v6), "[2001:db8::7]:80");
  EXPECT_FALSE(v6.is_loopback());
}

TEST(Peer, RecognisesLoopbackOfBothFamilies) {
  Peer v6;
  v6.address[15] = 1;
  EXPECT_TRUE(v6.is_loopback());
  EXPECT_TRUE((Peer{0x7f090909, 1}.is_loopback()));
  EXPECT_FALSE((Peer{0x0a000001, 1}.is_loopback()));
}

TEST(Peer, KernelFormIsConvertedBackUnchanged) {
  const Peer v4{0x0a000007, 4000};
  EXPECT_EQ(SocketAddress(v4, true).peer(), v4);
  EXPECT_EQ(SocketAddress(v4, false).peer(), v4) << "mapped, on an IPv6 socket";
  Peer v6({0xfe, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7}, 9);
  v6.scope = 2;
  EXPECT_EQ(SocketAddress(v6, false).peer(), v6);
}

TEST(Peer, AddressHashIgnoresThePort) {
  const std::array<std::uint64_t, 2> key{1, 2};
  EXPECT_EQ(address_hash(key, {0x0a000007, 1}), address_hash(key, {0x0a000007, 2}));
  EXPECT_NE(peer_hash(key, {0x0a000007, 1}), peer_hash(key, {0x0a000007, 2}));
}

TEST(Network, TextIsAnAddressWithTheLengthOfItsPrefix) {
  for (const std::string text :
       {"10.1.2.0/24", "10.0.0.7/32", "0.0.0.0/0", "192.168.128.0/17", "fd00:1::/64", "::1/128"}) {
    const auto network = parse_network(text);
    ASSERT_TRUE(network) << text;
    EXPECT_EQ(text_of(*network), text);
  }
  EXPECT_EQ(text_of(*parse_network("10.1.2.3/16")), "10.1.0.0/16") << "host bits do not count";
  EXPECT_EQ(text_of(*parse_network("10.1.2.3")), "10.1.2.3/32");
  for (const std::string text : {"", "10.0.0.0/33", "10.0.0.0/", "10.0.0.0/-1", "10.0.0.0/8x",
                                 "fd00::/129", "lab", "10.0.0/8", "/8"})
    EXPECT_FALSE(parse_network(text)) << text;
}

TEST(Network, ContainsItsAddressesAtAnyPort) {
  const Network lab = *parse_network("10.1.128.0/17");
  EXPECT_TRUE(lab.contains({0x0a018000, 1}));
  EXPECT_TRUE(lab.contains({0x0a01ffff, 65535}));
  EXPECT_FALSE(lab.contains({0x0a017fff, 1}));
  EXPECT_FALSE(parse_network("fd00::/8")->contains({0x0a018000, 1}));
  EXPECT_TRUE(parse_network("0.0.0.0/0")->contains({0x0a018000, 1}));
}

TEST(Network, LoopbackIsAttachedAndTheUsualNetworkHas24Bits) {
  EXPECT_THAT(attached_networks(), testing::Contains(*parse_network("127.0.0.0/8")));
  EXPECT_EQ(text_of(usual_network_of({0x0a010203, 9})), "10.1.2.0/24");
}

TEST(TrustedNetworks, FollowTheInterfacesAtALimitedRate) {
  const auto at = [](double seconds) { return Instant{} + from_seconds(1000 + seconds); };
  int queries = 0;
  std::vector<Network> attached{*parse_network("10.0.0.0/24")};
  TrustedNetworks trusted({*parse_network("172.16.0.0/12")}, [&] {
    ++queries;
    return attached;
  });
  EXPECT_TRUE(trusted.contains({0xac100001, 1}, at(0))) << "configured";
  EXPECT_TRUE(trusted.contains({0x0a000001, 1}, at(0)));
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE(trusted.contains({0xc0a80001, 1}, at(0.004 * i)));
  EXPECT_EQ(queries, 1);
  attached = {*parse_network("192.168.0.0/24")};
  EXPECT_TRUE(trusted.contains({0xc0a80001, 1}, at(6))) << "a new interface";
  EXPECT_FALSE(trusted.contains({0x0a000001, 1}, at(6))) << "a removed interface";
  EXPECT_EQ(queries, 2);
}

class BindTest : public testing::Test {
 protected:
  auto udp(const std::string& address, std::uint16_t port, std::string_view port_key = "port") {
    return bind_udp(io_, {address, port, "streaming.test", port_key});
  }
  auto tcp(const std::string& address) { return listen_tcp(io_, {address, 0, "streaming.test"}); }
  boost::asio::io_context io_;
};

TEST_F(BindTest, FindsAFreePort) {
  const auto first = udp("127.0.0.1", 0);
  const auto second = tcp("127.0.0.1");
  ASSERT_TRUE(first && second);
  EXPECT_GT(first->local_endpoint().port(), 0);
  EXPECT_GT(second->local_endpoint().port(), 0);
}

TEST_F(BindTest, ErrorOfAPortInUseNamesCommandAndKey) {
  const auto first = udp("127.0.0.1", 0);
  ASSERT_TRUE(first);
  const auto port = first->local_endpoint().port();
  const auto second = udp("127.0.0.1", port, "data_port");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text(), HasSubstr("ss -tulpn | grep " + std::to_string(port)));
  EXPECT_THAT(second.error().text(), HasSubstr("the port is used by this process itself"));
  EXPECT_THAT(second.error().text(), HasSubstr("streaming.test.data_port"));
}

TEST_F(BindTest, ErrorOfAWrongAddressNamesTheRemedy) {
  const auto foreign = tcp("192.0.2.1");
  ASSERT_FALSE(foreign);
  EXPECT_THAT(foreign.error().text(), HasSubstr("no interface with the address 192.0.2.1"));
  const auto name = udp("localhost", 0);
  ASSERT_FALSE(name);
  EXPECT_EQ(name.error().code, ErrorCode::kInvalid);
  EXPECT_THAT(name.error().text(), HasSubstr("streaming.test.address"));
}

TEST_F(BindTest, ErrorOfALowPortNamesAllRemedies) {
  const auto denied = boost::system::errc::make_error_code(boost::system::errc::permission_denied);
  const std::string text =
      bind_remedy(denied, {"0.0.0.0", 801, "streaming.vicon"}, Transport::kTcp);
  EXPECT_THAT(text, HasSubstr("setcap cap_net_bind_service"));
  EXPECT_THAT(text, HasSubstr("ip_unprivileged_port_start=801"));
  EXPECT_THAT(text, HasSubstr("streaming.vicon.port"));
}

}  // namespace
}  // namespace fiducap::net
