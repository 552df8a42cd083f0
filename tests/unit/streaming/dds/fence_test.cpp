// Announcements of participants (SPDP) that claim the address of a victim, sent as a stranger would
// send them. An answer proves that the middleware has read what came before it.
#include "middleware/fence.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "middleware/participant.hpp"
#include "support/network_namespace.hpp"

namespace fiducap::dds {
namespace {

constexpr int kDomain = 47;
constexpr int kMulticastPort = 7400 + 250 * kDomain;
constexpr int kUnicastPort = kMulticastPort + 10;  // of the first participant
constexpr const char* kGroup = "239.255.0.1";
constexpr const char* kBeyond = "192.168.213.66";
constexpr int kPatience_ms = 10'000;
constexpr std::size_t kLongest = 65536;

sockaddr_in ipv4(const std::string& address, int port) {
  sockaddr_in all{};
  all.sin_family = AF_INET;
  all.sin_port = htons(static_cast<std::uint16_t>(port));
  EXPECT_EQ(::inet_pton(AF_INET, address.c_str(), &all.sin_addr), 1) << address;
  return all;
}

/// A UDP socket in the namespace of the thread that makes it.
class Socket final {
 public:
  explicit Socket(const std::string& address, int port = 0) {
    const int yes = 1;
    ::setsockopt(fd_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    const auto own = ipv4(address, port);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)), 0) << address;
  }
  ~Socket() { ::close(fd_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  void join(const std::string& group, const std::string& interface) const {
    const ip_mreq wanted{ipv4(group, 0).sin_addr, ipv4(interface, 0).sin_addr};
    EXPECT_EQ(::setsockopt(fd_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &wanted, sizeof(wanted)), 0);
    EXPECT_EQ(::setsockopt(fd_, IPPROTO_IP, IP_MULTICAST_IF, &wanted.imr_interface,
                           sizeof(wanted.imr_interface)),
              0);
  }
  [[nodiscard]] int port() const {
    sockaddr_in own{};
    socklen_t size = sizeof(own);
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&own), &size);
    return ntohs(own.sin_port);
  }
  void send(const std::vector<std::uint8_t>& bytes, const std::string& address, int port) const {
    const auto to = ipv4(address, port);
    EXPECT_EQ(::sendto(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                       sizeof(to)),
              static_cast<ssize_t>(bytes.size()));
  }
  [[nodiscard]] bool hears_within(int patience_ms) const {
    pollfd readable{fd_, POLLIN, 0};
    return ::poll(&readable, 1, patience_ms) == 1;
  }
  [[nodiscard]] bool has_heard() const { return hears_within(0); }

 private:
  int fd_{::socket(AF_INET, SOCK_DGRAM, 0)};
};

void add_parameter(std::vector<std::uint8_t>& to, int id, const std::vector<std::uint8_t>& value) {
  to.insert(to.end(),
            {static_cast<std::uint8_t>(id), 0, static_cast<std::uint8_t>(value.size()), 0});
  to.insert(to.end(), value.begin(), value.end());
}

/// SPDP, little-endian, of a participant whose addresses are the victim's.
std::vector<std::uint8_t> announcement(std::uint8_t number, const std::string& victim, int port) {
  const std::vector<std::uint8_t> prefix{1, 0x10, 'f', 'o', 'r', 'g', 'e', 'd', 0, 0, 0, number};
  std::vector<std::uint8_t> guid = prefix;
  guid.insert(guid.end(), {0, 0, 1, 0xc1});
  std::vector<std::uint8_t> locator{
      1, 0, 0, 0, static_cast<std::uint8_t>(port), static_cast<std::uint8_t>(port >> 8)};
  locator.resize(20);
  const auto address = ipv4(victim, 0).sin_addr;
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&address);
  locator.insert(locator.end(), bytes, bytes + 4);
  std::vector<std::uint8_t> list{0, 3, 0, 0};
  add_parameter(list, 0x15, {2, 1, 0, 0});               // protocol version
  add_parameter(list, 0x16, {1, 0x10, 0, 0});            // vendor
  add_parameter(list, 0x02, {20, 0, 0, 0, 0, 0, 0, 0});  // lease, s
  add_parameter(list, 0x50, guid);
  add_parameter(list, 0x31, locator);             // default unicast
  add_parameter(list, 0x32, locator);             // metatraffic unicast
  add_parameter(list, 0x58, {0x3f, 0x0c, 0, 0});  // builtin endpoints
  add_parameter(list, 0x01, {});                  // end
  std::vector<std::uint8_t> data{0, 0, 16, 0, 0, 0, 0, 0, 0, 1, 0, 0xc2, 0, 0, 0, 0, 1, 0, 0, 0};
  data.insert(data.end(), list.begin(), list.end());
  std::vector<std::uint8_t> message{'R', 'T', 'P', 'S', 2, 1, 1, 0x10};
  message.insert(message.end(), prefix.begin(), prefix.end());
  message.insert(message.end(), {0x15, 5, static_cast<std::uint8_t>(data.size()), 0});
  message.insert(message.end(), data.begin(), data.end());
  return message;
}

class DdsFence : public testing::Test {
 protected:
  void SetUp() override {
    if (!hosts_.problem.empty()) GTEST_SKIP() << hosts_.problem;
    const std::string beyond = kBeyond;
    ASSERT_TRUE(hosts_.client.run("ip address add " + beyond + "/32 dev lo").done);
    ASSERT_TRUE(hosts_.server.run("ip route add " + beyond + " via " + TwoHosts::kClient).done);
  }
  void TearDown() override {
    hosts_.server.on([this] { participant_.reset(); });
  }
  void take_part(const std::string& interface, const std::vector<std::string>& peers = {}) {
    NetworkConfig config;
    config.domain = kDomain;
    config.interface = interface;
    config.peers = peers;
    hosts_.server.on([&] {
      auto joined = Participant::open(config);
      ASSERT_TRUE(joined) << joined.error().text();
      participant_ = *joined;
    });
  }
  std::unique_ptr<Socket> socket(NetworkNamespace& in, const std::string& address, int port = 0) {
    std::unique_ptr<Socket> made;
    in.on([&] { made = std::make_unique<Socket>(address, port); });
    return made;
  }
  std::unique_ptr<Socket> theirs(const std::string& address) {
    return socket(hosts_.client, address);
  }

  TwoHosts hosts_;
  std::shared_ptr<Participant> participant_;
};

TEST_F(DdsFence, OnLoopbackNothingFromOutsideIsHeard) {
  take_part("lo");
  const auto victim = socket(hosts_.server, "127.0.0.1");
  const auto neighbour = socket(hosts_.server, "127.0.0.1");
  const auto stranger = theirs(TwoHosts::kClient);
  stranger->send(announcement(1, "127.0.0.1", victim->port()), TwoHosts::kServer, kUnicastPort);
  neighbour->send(announcement(2, "127.0.0.1", neighbour->port()), "127.0.0.1", kUnicastPort);
  EXPECT_TRUE(neighbour->hears_within(kPatience_ms));
  EXPECT_FALSE(victim->has_heard());
}

TEST_F(DdsFence, OfACardItsOwnNetworkIsHeardAndNoSenderBeyond) {
  take_part(TwoHosts::kServer);
  const auto stranger = theirs(kBeyond);
  const auto victim = theirs(TwoHosts::kClient);
  const auto neighbour = theirs(TwoHosts::kClient);
  stranger->send(announcement(1, TwoHosts::kClient, victim->port()), TwoHosts::kServer,
                 kUnicastPort);
  neighbour->send(announcement(2, TwoHosts::kClient, neighbour->port()), TwoHosts::kServer,
                  kUnicastPort);
  EXPECT_TRUE(neighbour->hears_within(kPatience_ms));
  EXPECT_FALSE(victim->has_heard());
}

TEST_F(DdsFence, ANeighbourCannotHaveAddressesBeyondAnswered) {
  take_part(TwoHosts::kServer);
  const auto victim = theirs(kBeyond);
  const auto neighbour = theirs(TwoHosts::kClient);
  neighbour->send(announcement(1, kBeyond, victim->port()), TwoHosts::kServer, kUnicastPort);
  neighbour->send(announcement(2, TwoHosts::kClient, neighbour->port()), TwoHosts::kServer,
                  kUnicastPort);
  EXPECT_TRUE(neighbour->hears_within(kPatience_ms));
  EXPECT_FALSE(victim->has_heard());
}

TEST_F(DdsFence, PeersBeyondAreHeardAndAnswered) {
  take_part(TwoHosts::kServer, {kBeyond});
  const auto peer = theirs(kBeyond);
  peer->send(announcement(1, kBeyond, peer->port()), TwoHosts::kServer, kUnicastPort);
  EXPECT_TRUE(peer->hears_within(kPatience_ms));
}

TEST_F(DdsFence, MulticastOfTheOwnNetworkPassesBothWays) {
  const auto group = socket(hosts_.client, "0.0.0.0", kMulticastPort);
  hosts_.client.on([&] { group->join(kGroup, TwoHosts::kClient); });
  take_part(TwoHosts::kServer);
  EXPECT_TRUE(group->hears_within(kPatience_ms)) << "the server's own announcement";
  const auto neighbour = theirs(TwoHosts::kClient);
  hosts_.client.on([&] {
    neighbour->join(kGroup, TwoHosts::kClient);
    neighbour->send(announcement(1, TwoHosts::kClient, neighbour->port()), kGroup, kMulticastPort);
  });
  EXPECT_TRUE(neighbour->hears_within(kPatience_ms));
}

}  // namespace
}  // namespace fiducap::dds
