// Bytes that a blind sender draws from UDP sockets to a forged address beyond all networks of the
// server. They are counted on the wire, as bytes of IP, and not answered. Every UDP socket of the
// process has its test here, those of sensors included. (DDS: fence_test. Vicon has no UDP.)
#include <gtest/gtest.h>
#include <net/ethernet.h>
#include <netinet/ip.h>
#include <poll.h>

#include <array>
#include <chrono>
#include <cstring>
#include <iostream>
#include <thread>

#include "capture/imu/imu_source.hpp"
#include "fiducap/v1/envelope.pb.h"
#include "middleware/mavlink/frame.hpp"
#include "streaming/mavlink/mavlink.hpp"
#include "streaming/native/frames.hpp"
#include "streaming/native/native.hpp"
#include "streaming/natnet/natnet.hpp"
#include "streaming/qualisys/qualisys.hpp"
#include "streaming/vrpn/vrpn.hpp"
#include "support/hex.hpp"
#include "support/loopback_socket.hpp"
#include "support/network_namespace.hpp"
#include "support/real_clock.hpp"
#include "support/scene_builder.hpp"
#include "unit/capture/imu/mavlink_bytes.hpp"
#include "unit/streaming/natnet/messages.hpp"

namespace fiducap {
namespace {

using Bytes = std::vector<std::byte>;
using Steady = std::chrono::steady_clock;

constexpr const char* kVictim = "192.168.213.66";
constexpr std::uint16_t kVictimPort = 5555;
constexpr std::size_t kHeaders = 28;  // IPv4 and UDP
constexpr double kAllowed = 3;
// Longer than the seconds in which the kernel repeats a SYN.
constexpr auto kListen = std::chrono::seconds(5);
constexpr auto kFrame = std::chrono::milliseconds(10);

/// Sends under the victim's address and counts packets to it, in the namespace of the calling
/// thread.
class Forger final {
 public:
  Forger() {
    const int yes = 1;
    ok_ = ::setsockopt(sender_, SOL_IP, IP_TRANSPARENT, &yes, sizeof(yes)) == 0;
    const auto own = ipv4(kVictim, kVictimPort);
    ok_ = ok_ && ::bind(sender_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)) == 0;
    ok_ = ok_ && tap_ >= 0;
  }
  ~Forger() {
    ::close(sender_);
    ::close(tap_);
  }
  Forger(const Forger&) = delete;
  Forger& operator=(const Forger&) = delete;

  [[nodiscard]] bool ok() const { return ok_; }
  void send(const Bytes& bytes, std::uint16_t port) {
    const auto to = ipv4(TwoHosts::kServer, port);
    const auto sent = ::sendto(sender_, bytes.data(), bytes.size(), 0,
                               reinterpret_cast<const sockaddr*>(&to), sizeof(to));
    ASSERT_EQ(sent, static_cast<ssize_t>(bytes.size())) << std::strerror(errno);
    sent_ += bytes.size() + kHeaders;
  }
  void listen(std::chrono::milliseconds duration) {
    const auto end = Steady::now() + duration;
    for (auto now = Steady::now(); now < end; now = Steady::now()) {
      pollfd readable{tap_, POLLIN, 0};
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - now);
      if (::poll(&readable, 1, static_cast<int>(left.count())) == 1) count();
    }
  }
  [[nodiscard]] std::size_t sent() const { return sent_; }
  [[nodiscard]] std::size_t drawn() const { return drawn_; }

 private:
  void count() {
    alignas(iphdr) std::array<std::byte, 65536> packet{};
    const auto size = ::recv(tap_, packet.data(), packet.size(), MSG_DONTWAIT);
    iphdr header{};
    if (size < static_cast<ssize_t>(sizeof(header))) return;
    std::memcpy(&header, packet.data(), sizeof(header));
    if (header.daddr == ipv4(kVictim, 0).sin_addr.s_addr) drawn_ += ntohs(header.tot_len);
  }

  int sender_{::socket(AF_INET, SOCK_DGRAM, 0)};
  int tap_{::socket(AF_PACKET, SOCK_DGRAM, htons(ETHERTYPE_IP))};
  bool ok_{false};
  std::size_t sent_{0};
  std::size_t drawn_{0};
};

class UdpAmplification : public testing::Test {
 protected:
  void SetUp() override {
    if (!hosts_.problem.empty()) GTEST_SKIP() << hosts_.problem;
    ASSERT_TRUE(
        hosts_.server.run(std::string("ip route add ") + kVictim + " via " + TwoHosts::kClient)
            .done);
    hosts_.client.on([this] { forger_ = std::make_unique<Forger>(); });
    ASSERT_TRUE(forger_->ok()) << "no forged addresses: " << std::strerror(errno);
  }
  /// @param make  starts the server
  template <typename Make>
  void serve(Make&& make) {
    hosts_.server.on([&] {
      auto server = make(io_);
      ASSERT_TRUE(server) << server.error().text();
      server_ = std::move(*server);
      thread_ = std::thread([this] { run(); });
    });
    ASSERT_TRUE(server_);
  }
  void TearDown() override {
    if (!server_) return;
    boost::asio::post(io_, [this] {
      server_->stop();
      stopped_ = true;
    });
    if (thread_.joinable()) thread_.join();
  }
  void expect_little() { expect_little(server_->protocol()); }
  void expect_little(std::string_view peer) {
    forger_->listen(kListen);
    const double ratio =
        static_cast<double>(forger_->drawn()) / static_cast<double>(forger_->sent());
    std::cout << peer << ": " << forger_->sent() << " bytes drew " << forger_->drawn() << ", x "
              << ratio << std::endl;
    EXPECT_LE(ratio, kAllowed) << peer;
  }

  /// Opens an IMU source, sends these bytes to it and counts what it sends.
  void forge_to(const ImuSourceConfig& config, std::uint16_t port, const std::string& what,
                const Bytes& bytes) {
    forger_.reset();  // its port is free before the next one binds it
    hosts_.client.on([this] { forger_ = std::make_unique<Forger>(); });
    ASSERT_TRUE(forger_->ok()) << std::strerror(errno);
    Expected<std::unique_ptr<SensorSource>> source = fail(ErrorCode::kClosed, "");
    std::jthread reader;
    hosts_.server.on([&] {
      source = open_imu_source(config, {clock_, {}});
      ASSERT_TRUE(source) << source.error().text();
      reader = std::jthread([&source](std::stop_token stop) {
        while (!stop.stop_requested()) (void)(*source)->next(stop);
      });
    });
    forger_->send(bytes, port);
    expect_little(what);
    reader.request_stop();
    reader.join();
  }

  TwoHosts hosts_;
  RealClock clock_;
  std::shared_ptr<const SceneModel> model_ = make_scene_frame({"arm", "drone"})->model;
  std::unique_ptr<Forger> forger_;

 private:
  void run() {
    auto due = Steady::now();
    for (std::uint64_t number = 1; !stopped_; ++number) {
      server_->publish(make_scene_frame({"arm", "drone"}, number));
      due += kFrame;
      io_.restart();
      io_.run_until(due);
    }
    server_.reset();
    io_.restart();
    io_.run();
  }

  boost::asio::io_context io_{1};
  std::unique_ptr<Streamer> server_;
  bool stopped_{false};
  std::thread thread_;
};

TEST_F(UdpAmplification, VrpnConnectsToStrangersOnce) {
  vrpn::VrpnConfig config;
  config.address = TwoHosts::kServer;
  config.port = 3883;
  serve([&](auto& io) { return vrpn::serve({io, model_, clock_}, config); });
  const std::string request = std::string(kVictim) + " 7000";
  Bytes bytes(request.size() + 1);
  std::memcpy(bytes.data(), request.data(), request.size());
  forger_->send(bytes, config.port);
  expect_little();
}

TEST_F(UdpAmplification, QualisysAnswersStrangersInProportion) {
  qualisys::QualisysConfig config;
  config.address = TwoHosts::kServer;
  serve([&](auto& io) { return qualisys::serve({io, model_, clock_}, config); });
  Bytes question;
  question.reserve(16);
  LittleEndianWriter(question).u32(10).u32(7).u8(kVictimPort >> 8).u8(kVictimPort & 0xff);
  for (int i = 0; i < 100; ++i) forger_->send(question, config.discovery_port);
  expect_little();
}

TEST_F(UdpAmplification, MavlinkImuSendsStrangersLittle) {
  ImuSourceConfig config;
  config.type = ImuSourceType::kMavlink;
  config.mavlink.link.port = 14540;
  config.mavlink.rate_hz = 200;
  const auto timesync = [](const mavlink::Timesync& one) {
    Bytes bytes;
    mavlink::encode_timesync({3, 1, 0}, one, bytes);
    return bytes;
  };
  const auto heartbeat = from_hex(mavlink::golden::kHeartbeatOfPx4);
  Bytes long_one = heartbeat;
  long_one.resize(1400);
  Bytes questions = heartbeat;
  for (int i = 1; i <= 20; ++i) {
    const auto one = timesync({0, i});
    questions.insert(questions.end(), one.begin(), one.end());
  }
  const std::vector<std::pair<std::string, Bytes>> kinds{
      {"heartbeat", heartbeat},
      {"heartbeat of MAVLink 1", from_hex(mavlink::golden::kHeartbeatOfArduPilot)},
      {"readings", from_hex(mavlink::golden::kHighres)},
      {"readings of MAVLink 1", from_hex(mavlink::golden::kRaw)},
      {"TIMESYNC question", timesync({0, 5})},
      {"TIMESYNC answer, guessed", timesync({5, 6})},
      {"heartbeat and questions", questions},
      {"heartbeat in a long datagram", long_one}};
  for (const auto& [what, bytes] : kinds) forge_to(config, 14540, "IMU, MAVLink, " + what, bytes);
}

TEST_F(UdpAmplification, ImuLinesAreNotAnswered) {
  ImuSourceConfig config;
  config.line.port = 5005;
  const std::string line = "\nIMU,1000000,0.01,-0.02,0.03,0.1,-0.2,9.81*4F\n";
  const auto bytes = std::as_bytes(std::span(line.data(), line.size()));
  forge_to(config, 5005, "IMU, line", {bytes.begin(), bytes.end()});
}

TEST_F(UdpAmplification, MavlinkServerIgnoresStrangers) {
  mavlink::MavlinkConfig config;
  config.address = TwoHosts::kServer;
  config.port = 14550;
  mavlink::VehicleConfig vehicle;
  vehicle.body = "drone";
  vehicle.address = TwoHosts::kClient;
  vehicle.port = 14580;
  config.vehicles = {vehicle};
  serve([&](auto& io) { return mavlink::serve({io, model_, clock_}, config); });
  Bytes question = from_hex(mavlink::golden::kHeartbeatOfPx4);
  mavlink::encode_timesync({3, 1, 0}, {0, 5}, question);
  forger_->send(question, config.port);
  expect_little();
}

TEST_F(UdpAmplification, NativeAnswersStrangersInProportion) {
  native::NativeConfig config;
  config.address = TwoHosts::kServer;
  serve([&](auto& io) { return native::serve({io, model_, clock_}, config); });
  const auto send = [&](auto fill) {
    v1::Envelope envelope;
    envelope.set_protocol(native::kProtocol);
    fill(envelope);
    Bytes bytes(envelope.ByteSizeLong());
    envelope.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
    forger_->send(bytes, config.port);
  };
  for (const std::size_t padding : {0, 400}) {
    send([&](auto& all) { all.mutable_subscribe()->set_padding(std::string(padding, ' ')); });
    send([&](auto& all) { all.mutable_discovery_query()->set_padding(std::string(padding, ' ')); });
    send([&](auto& all) { all.mutable_subscribe()->set_token(7); });
    send([&](auto& all) { all.mutable_clock_query()->set_token(7); });
    send([&](auto& all) { all.mutable_unsubscribe()->set_token(7); });
  }
  expect_little();
}

TEST_F(UdpAmplification, NatNetSendsStrangersNoFrames) {
  natnet::NatNetConfig config;
  config.address = TwoHosts::kServer;
  serve([&](auto& io) {
    return natnet::serve({.io = io, .model = model_, .clock = clock_, .rate_hz = 100}, config);
  });
  forger_->send(natnet::message(natnet::Message::kConnect, natnet::sender_block({4, 0})),
                config.port);
  for (int i = 0; i < 10; ++i) {
    forger_->send(natnet::message(natnet::Message::kKeepAlive), config.port);
    forger_->send(natnet::message(natnet::Message::kRequestModel), config.port);
    forger_->send(natnet::message(natnet::Message::kRequestFrame), config.port);
  }
  expect_little();
}

}  // namespace
}  // namespace fiducap
