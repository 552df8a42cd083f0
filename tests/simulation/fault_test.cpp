// Failed allocations in a running server: every protocol and thread continues.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <algorithm>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <functional>
#include <random>

#include "support/allocation_counter.hpp"
#include "support/running_server.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using asio::ip::udp;

constexpr timeval kTimeout{5, 0};

template <typename Socket>
Socket connect(asio::io_context& io, std::uint16_t port) {
  Socket socket(io);
  socket.connect({asio::ip::address_v4::loopback(), port});
  ::setsockopt(socket.native_handle(), SOL_SOCKET, SO_RCVTIMEO, &kTimeout, sizeof(kTimeout));
  return socket;
}

/// Sends `what` to a port. @return whether there is a reply
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
  explicit ServerUnderFaults(std::function<void()> first = &AllocationFault::reach_this_thread)
      : server_(config(), {}, std::move(first)) {}

  ServerConfig config() const {
    ServerConfig demo = corner_demo();
    demo.streaming.rate_hz = 200;
    demo.operators.token = kToken;
    demo.map.store = folder_.file("map.sqlite");
    demo.recorder.folder = folder_.file("recordings");
    return demo;
  }
  /// The protocols that do not answer.
  std::string deaf() {
    const ProtocolPorts ports = server_->ports();
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
  /// A connection is accepted: the server ends it after a malformed message.
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

  static constexpr const char* kToken = "correct horse battery";
  TemporaryFolder folder_;
  RunningServer server_;
  Client client_{server_.client_options()};
};

/// Any one allocation of the I/O thread fails, 300 times, while clients come and go.
TEST_F(ServerUnderFaults, EveryProtocolSurvivesFailedAllocations) {
  ASSERT_EQ(deaf(), "") << "before any fault";
  std::mt19937 random(20261123);
  std::uniform_int_distribution<int> nth(1, 40);
  int failed = 0;
  for (int i = 0; i < 300; ++i) {
    AllocationFault::arm(nth(random));
    const ProtocolPorts ports = server_->ports();
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

/// The same in every other thread, while the server records, stores its map and serves its page.
class ThreadUnderFaults : public ServerUnderFaults,
                          public testing::WithParamInterface<const char*> {
 protected:
  ThreadUnderFaults() : ServerUnderFaults([] {}) {}

  /// Uses what the threads work for.
  void use_all(const std::string& recording) {
    (void)control_.start_recording(recording);
    (void)control_.commit_map();
    (void)answers<tcp::socket>(server_->ports().web, "GET /api/v1/state HTTP/1.0\r\n\r\n");
    wait_for_frames(20);
    (void)control_.stop_recording();
  }
  void wait_for_frames(int count) {
    Frame frame;
    auto last = client_.latest(frame) ? frame.number : 0;
    for (; count > 0 && client_.wait_for_frame(last, std::chrono::seconds(5)); --count) {
      if (client_.latest(frame)) last = frame.number;
    }
  }
  bool comes_true(const std::function<bool()>& condition) {
    for (int i = 0; i < 3000; ++i) {  // a minute: a body may have to come to a tag of the map
      if (condition()) return true;
      wait_for_frames(4);
    }
    return false;
  }
  bool bodies_are_valid() {
    Frame frame;
    return client_.latest(frame) && frame.bodies.size() == 3 &&
           std::all_of(frame.bodies.begin(), frame.bodies.end(),
                       [](const Body& body) { return body.valid; });
  }
  RecordingState state_of(const std::string& name) {
    ControlState state;
    (void)control_.list(state);
    for (const Recording& one : state.recordings)
      if (one.name == name) return one.state;
    return RecordingState::kFailed;
  }

  Control control_{server_.control_options(kToken)};
};

TEST_P(ThreadUnderFaults, SurvivesFailedAllocations) {
  ASSERT_TRUE(comes_true([this] { return bodies_are_valid(); }));
  std::mt19937 random(20261124);
  std::uniform_int_distribution<int> nth(1, 60);
  AllocationFault::reach_threads(GetParam());
  constexpr int kEnough = 5;
  int failed = 0;
  // A thread that works twice a second has few faults per round.
  for (int i = 0; i < 40 || (failed <= kEnough && i < 400); ++i) {
    AllocationFault::arm(nth(random));
    use_all("during" + std::to_string(i));
    failed += AllocationFault::disarm() ? 1 : 0;
  }
  AllocationFault::reach_threads("");
  EXPECT_GT(failed, kEnough);
  EXPECT_EQ(deaf(), "") << "after " << failed << " faults";
  EXPECT_TRUE(comes_true([this] { return bodies_are_valid(); }));
  use_all("afterwards");
  EXPECT_TRUE(comes_true([this] { return state_of("afterwards") == RecordingState::kFinished; }));
  server_.stop();
  EXPECT_TRUE(server_.clean());
}

INSTANTIATE_TEST_SUITE_P(Each, ThreadUnderFaults,
                         testing::Values("pages", "read", "recorder", "watch", "work"),
                         [](const auto& thread) { return std::string(thread.param); });

}  // namespace
}  // namespace fiducap
