// What breaks inside of a running server costs what it belongs to, and nothing else for longer
// than a moment.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <fiducap/client.hpp>
#include <random>

#include "support/allocation_counter.hpp"
#include "support/running_server.hpp"

namespace fiducap {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using asio::ip::udp;

constexpr timeval kPatience{5, 0};

template <typename Socket>
Socket connect(asio::io_context& io, std::uint16_t port) {
  Socket socket(io);
  socket.connect({asio::ip::address_v4::loopback(), port});
  ::setsockopt(socket.native_handle(), SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof(kPatience));
  return socket;
}

/// Says `what` to a port. @return whether anything is answered
template <typename Socket>
bool answers(std::uint16_t port, std::string_view what) {
  asio::io_context io;
  boost::system::error_code error;
  auto socket = connect<Socket>(io, port);
  if (!what.empty()) socket.send(asio::buffer(what.data(), what.size()), 0, error);
  std::array<char, 2048> answer{};
  return socket.receive(asio::buffer(answer), 0, error) > 0;
}

constexpr std::string_view kVrpnHello{"vrpn: ver. 07.35  0\0\0\0\0\0", 24};
constexpr std::string_view kNatNetPing{"\x00\x00\x00\x00", 4};
constexpr std::string_view kNatNetEcho{"\x0c\x00\x08\x00\x01\x02\x03\x04\x05\x06\x07\x08", 12};

class ServerUnderFaults : public testing::Test {
 protected:
  static ServerConfig config() {
    ServerConfig demo = corner_demo();
    demo.streaming.rate_hz = 200;
    return demo;
  }
  /// Which protocols do not answer; `all` is empty when everything is well.
  std::string deaf() {
    const ServerPorts ports = server_->ports();
    std::string all;
    const auto ask = [&](const char* name, bool answered) {
      if (!answered) all += std::string(name) + " ";
    };
    ask("vrpn", answers<tcp::socket>(ports.vrpn, kVrpnHello));
    ask("natnet", answers<udp::socket>(ports.natnet, kNatNetEcho));
    ask("qualisys", answers<tcp::socket>(ports.qualisys, ""));
    ask("web", answers<tcp::socket>(ports.web, "GET /healthz HTTP/1.0\r\n\r\n"));
    ask("native control", knock(ports.native));
    Frame frame;
    const auto before = client_.latest(frame) ? frame.number : 0;
    ask("native", client_.wait_for_frame(before, std::chrono::seconds(5)));
    return all;
  }
  /// A connection is taken in: it is ended by a malformed message.
  static bool knock(std::uint16_t port) {
    asio::io_context io;
    boost::system::error_code error;
    auto socket = connect<tcp::socket>(io, port);
    const std::string garbage(64, '\xff');
    socket.send(asio::buffer(garbage), 0, error);
    std::array<char, 256> answer{};
    socket.receive(asio::buffer(answer), 0, error);
    return error != asio::error::would_block && error != asio::error::try_again;
  }

  RunningServer server_{config(), {}, &AllocationFault::reach_this_thread};
  Client client_{[this] {
    ClientOptions options;
    options.port = server_->ports().native;
    return options;
  }()};
};

/// Any one allocation of the I/O thread fails, 300 times over, while clients come and go.
TEST_F(ServerUnderFaults, EveryProtocolGoesOnAfterAllocationsThatFailed) {
  ASSERT_EQ(deaf(), "") << "before any fault";
  std::mt19937 random(20261123);
  std::uniform_int_distribution<int> nth(1, 40);
  int failed = 0;
  for (int i = 0; i < 300; ++i) {
    AllocationFault::arm(nth(random));
    const ServerPorts ports = server_->ports();
    {
      asio::io_context io;
      boost::system::error_code ignored;
      auto vrpn = connect<tcp::socket>(io, ports.vrpn);
      auto vicon = connect<tcp::socket>(io, ports.vicon);
      auto qualisys = connect<tcp::socket>(io, ports.qualisys);
      auto web = connect<tcp::socket>(io, ports.web);
      auto natnet = connect<udp::socket>(io, ports.natnet);
      vrpn.send(asio::buffer(kVrpnHello.data(), kVrpnHello.size()), 0, ignored);
      natnet.send(asio::buffer(kNatNetPing.data(), kNatNetPing.size()), 0, ignored);
      Frame frame;
      const auto before = client_.latest(frame) ? frame.number : 0;
      client_.wait_for_frame(before, std::chrono::seconds(1));
    }
    failed += AllocationFault::disarm() ? 1 : 0;
    if (i % 10 == 9) {
      ASSERT_EQ(deaf(), "") << "after " << failed << " faults, round " << i;
    }
  }
  EXPECT_GT(failed, 200);
  server_.stop();
  EXPECT_TRUE(server_.clean());
}

}  // namespace
}  // namespace fiducap
