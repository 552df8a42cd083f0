// What the servers of all protocols have in common: ports, limits, and how they end.
#include <gmock/gmock.h>

#include <functional>
#include <string>
#include <vector>

#include "streaming/mavlink/mavlink.hpp"
#include "streaming/native/native.hpp"
#include "streaming/natnet/natnet.hpp"
#include "streaming/qualisys/qualisys.hpp"
#include "streaming/vicon/vicon.hpp"
#include "streaming/vrpn/vrpn.hpp"
#include "streaming/web/web.hpp"
#include "support/fake_operator_api.hpp"
#include "support/loopback_socket.hpp"
#include "unit/streaming/server_fixture.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// Sends nothing by itself.
class SilentClient final {
 public:
  explicit SilentClient(int port) : fd_(connected_socket(static_cast<std::uint16_t>(port))) {}
  ~SilentClient() { ::close(fd_); }
  SilentClient(const SilentClient&) = delete;
  SilentClient& operator=(const SilentClient&) = delete;

  void pump() { closed = closed || !read_stream(fd_, in_); }
  void send_garbage() {
    const std::vector<std::byte> garbage(32, std::byte{0xff});
    EXPECT_EQ(::send(fd_, garbage.data(), garbage.size(), MSG_NOSIGNAL), 32);
  }
  bool closed{false};

 private:
  int fd_;
  std::vector<std::byte> in_;
};

class Servers : public ServerStage<SilentClient> {
 protected:
  /// A protocol by its section, with the key of its port there.
  struct Protocol {
    std::string section, port_key;
    std::function<StartedStreamer(const std::string& address, int port)> start;
    int tcp_offset{0};  ///< Of the port for TCP.
  };
  template <class Config>
  Protocol of(const char* section, std::uint16_t Config::*port, Config config = {},
              const char* port_key = "port") {
    return {section, port_key, [this, config, port](const std::string& address, int at) {
              Config changed = config;
              changed.address = address;
              changed.*port = static_cast<std::uint16_t>(at);
              return serve({.io = io_,
                            .model = make_scene_frame(names_)->model,
                            .clock = clock_,
                            .operator_api = &operator_api_,
                            .rate_hz = 100},
                           changed);
            }};
  }
  /// Those with a session for each client; a single address has two places.
  std::vector<Protocol> with_sessions() {
    vrpn::VrpnConfig vrpn;
    vrpn.max_clients = 2;
    vicon::ViconConfig vicon;
    vicon.max_clients_per_address = 2;
    qualisys::QualisysConfig qualisys;
    qualisys.max_clients_per_address = 2;
    qualisys.discovery_port = 0;
    std::vector<Protocol> protocols{
        of("streaming.vrpn", &vrpn::VrpnConfig::port, vrpn),
        of("streaming.vicon", &vicon::ViconConfig::port, vicon),
        of("streaming.qualisys", &qualisys::QualisysConfig::base_port, qualisys, "base_port")};
    protocols[2].tcp_offset = 1;  // for little-endian clients
    return protocols;
  }
  std::vector<Protocol> all() {
    natnet::NatNetConfig natnet;
    natnet.multicast = false;
    auto protocols = with_sessions();
    protocols.push_back(of("streaming.natnet", &natnet::NatNetConfig::port, natnet));
    protocols.push_back(of("streaming.native", &native::NativeConfig::port));
    protocols.push_back(of("streaming.mavlink", &mavlink::MavlinkConfig::port));
    protocols.push_back(of("streaming.web", &web::WebConfig::port));
    return protocols;
  }

  FakeOperatorApi operator_api_;
};

TEST_F(Servers, ErrorsNameTheKeyOfThePortAndOfTheAddress) {
  for (const auto& [section, port_key, start, offset] : all()) {
    const auto first = start("127.0.0.1", 0);
    ASSERT_TRUE(first) << first.error().text();
    const auto in_use = start("127.0.0.1", (*first)->port());
    ASSERT_FALSE(in_use) << section;
    EXPECT_EQ(in_use.error().code, ErrorCode::kUnavailable);
    EXPECT_THAT(in_use.error().text(), AllOf(HasSubstr(std::to_string((*first)->port())),
                                             HasSubstr(section + "." + port_key)));
    const auto foreign = start("192.0.2.77", 0);  // reserved for documentation
    ASSERT_FALSE(foreign) << section;
    EXPECT_THAT(foreign.error().text(),
                AllOf(HasSubstr("192.0.2.77"), HasSubstr(section + ".address")));
  }
}

TEST_F(Servers, ReleaseTheirPortsWhenTheyStop) {
  for (const auto& [section, port_key, start, offset] : all()) {
    auto first = start("127.0.0.1", 0);
    ASSERT_TRUE(first) << first.error().text();
    (*first)->publish(frame());
    (*first)->stop();
    EXPECT_TRUE(start("127.0.0.1", (*first)->port())) << section;
  }
  EXPECT_NO_THROW(io_.poll()) << "servers may end before their io_context";
}

TEST_F(Servers, RefuseMoreBodiesThanTheProtocolCarries) {
  names_.assign(1025, "x");
  for (const auto& [section, port_key, start, offset] : all()) {
    if (section != "streaming.natnet" && section != "streaming.native") continue;
    const auto server = start("127.0.0.1", 0);
    ASSERT_FALSE(server) << section;
    EXPECT_EQ(server.error().code, ErrorCode::kInvalid);
  }
}

TEST_F(Servers, CloseSilentClientsThoseThatSendGarbageAndThoseAboveTheLimit) {
  for (const auto& [section, port_key, start, offset] : with_sessions()) {
    auto server = start("127.0.0.1", 0);
    ASSERT_TRUE(server) << server.error().text();
    const int port = (*server)->port();
    {
      SilentClient silent(port + offset), loud(port + offset), late(port + offset);
      clients_ = {&silent, &loud, &late};
      EXPECT_TRUE(until([&] { return late.closed; })) << section << ": two places";
      loud.send_garbage();
      EXPECT_TRUE(until([&] { return loud.closed; })) << section;
      EXPECT_FALSE(silent.closed) << section;
      clock_.advance(std::chrono::seconds(11));
      EXPECT_TRUE(until([&] { return silent.closed; })) << section;
      clients_.clear();
    }
    (*server)->stop();
    EXPECT_TRUE(start("127.0.0.1", port)) << section << ": again on the same port, at once";
  }
}

}  // namespace
}  // namespace fiducap
