#include "streaming/qualisys/qualisys.hpp"

#include <gmock/gmock.h>

#include <boost/asio/post.hpp>
#include <functional>

#include "base/bytes.hpp"
#include "fake_operator_api.hpp"
#include "streaming/qualisys/codec.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "support/loopback_socket.hpp"
#include "unit/streaming/server_fixture.hpp"

namespace fiducap::qualisys {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::byte>;

/// A client on real loopback sockets that reads on request.
class RtClient final {
 public:
  explicit RtClient(int port, std::endian order = std::endian::little)
      : order_(order), tcp_(connected_socket(static_cast<std::uint16_t>(port))) {}
  ~RtClient() {
    ::close(tcp_);
    if (udp_ >= 0) ::close(udp_);
  }
  RtClient(const RtClient&) = delete;
  RtClient& operator=(const RtClient&) = delete;

  void say(std::string_view command) {
    Bytes out;
    encode_text(order_, PacketType::kCommand, command, out);
    send(out);
  }
  void send(std::span<const std::byte> bytes) {
    closed = ::send(tcp_, bytes.data(), bytes.size(), MSG_NOSIGNAL) < 0 || closed;
  }
  /// Opens a UDP socket. @return its port
  std::uint16_t open_udp() {
    udp_ = bound_socket(SOCK_DGRAM);
    return port_of(udp_);
  }
  /// Reads all that came; never waits.
  void pump() {
    closed = !read_stream(tcp_, in_) || closed;
    std::size_t used = 0;
    for (;;) {
      const auto rest = std::span<const std::byte>(in_).subspan(used);
      const auto packet = decode_packet(order_, rest);
      if (!packet || !*packet) break;
      take(**packet, rest.first((*packet)->size));
      used += (*packet)->size;
    }
    in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
    if (udp_ < 0) return;
    while (auto datagram = read_datagram(udp_)) udp_frames.push_back(std::move(*datagram));
  }
  [[nodiscard]] bool heard(const std::string& text) const {
    return std::find(texts.begin(), texts.end(), text) != texts.end();
  }
  [[nodiscard]] std::size_t frames() const { return tcp_frames.size() + udp_frames.size(); }

  std::vector<std::string> texts;
  std::vector<Event> events;
  std::vector<Bytes> tcp_frames;
  std::vector<Bytes> udp_frames;
  bool closed{false};

 private:
  void take(const Packet& packet, std::span<const std::byte> whole) {
    if (packet.type == PacketType::kData) {
      tcp_frames.emplace_back(whole.begin(), whole.end());
    } else if (packet.type == PacketType::kEvent) {
      events.push_back(static_cast<Event>(packet.payload[0]));
    } else if (packet.type != PacketType::kNoMoreData) {
      texts.emplace_back(decode_text(packet.payload));
    }
  }

  std::endian order_;
  int tcp_;
  int udp_{-1};
  Bytes in_;
};

class QualisysServer : public ServerStage<RtClient> {
 protected:
  ~QualisysServer() override { end_server(); }
  void start() {
    config_.base_port = 0;
    config_.discovery_port = discovery_;
    auto server = serve({io_, make_scene_frame(names_)->model, clock_, &operator_api_}, config_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    base_ = server_->port();
  }
  /// Speaks version 1.28 and requests a stream.
  void begin(RtClient& client, const std::string& stream = "StreamFrames AllFrames 6D") {
    clients_.push_back(&client);
    client.say("Version 1.28");
    client.say(stream);
    client.say("ByteOrder");
    ASSERT_TRUE(until([&] { return client.texts.size() >= 3; }));
  }
  void begin_udp(RtClient& client, const std::string& components) {
    begin(client,
          "StreamFrames AllFrames UDP:" + std::to_string(client.open_udp()) + " " + components);
  }

  FakeOperatorApi operator_api_;
  QualisysConfig config_;
  std::uint16_t discovery_{0};
  std::uint16_t base_{0};
};

TEST_F(QualisysServer, StreamsByTcpInBothByteOrders) {
  start();
  RtClient little(base_ + 1), big(base_ + 2, std::endian::big);
  begin(little);
  begin(big);
  EXPECT_TRUE(little.heard("QTM RT Interface connected"));
  EXPECT_TRUE(big.heard("Byte order is big endian"));
  publish();
  ASSERT_TRUE(until([&] { return little.frames() == 1 && big.frames() == 1; }));
  EXPECT_EQ(LittleEndianReader(std::span(little.tcp_frames[0]).subspan(40)).f32(), 1000.0F);
  EXPECT_EQ(BigEndianReader(std::span(big.tcp_frames[0]).subspan(40)).f32(), 1000.0F);
}

TEST_F(QualisysServer, StreamsByUdpToEveryClientThatRequestsIt) {
  start();
  RtClient a(base_ + 1), b(base_ + 1);
  begin_udp(a, "6DEuler");
  begin_udp(b, "6DEuler");
  for (int i = 0; i < 3; ++i) publish();
  ASSERT_TRUE(until([&] { return a.udp_frames.size() == 3 && b.udp_frames.size() == 3; }));
  EXPECT_THAT(a.tcp_frames, testing::IsEmpty());
  EXPECT_EQ(a.udp_frames, b.udp_frames);
  EXPECT_THAT(status().at(0).peer, HasSubstr("udp"));
  EXPECT_EQ(status().at(0).frames_sent, 3u);
  EXPECT_EQ(status().at(0).frames_dropped, 0u);
}

TEST_F(QualisysServer, SendsTheCurrentFrameOnce) {
  start();
  publish();
  RtClient client(base_ + 1);
  begin(client, "GetCurrentFrame 6D");
  ASSERT_TRUE(until([&] { return client.frames() == 1; }));
  client.say("GetCurrentFrame 6D");
  client.say("QTMVersion");
  ASSERT_TRUE(until([&] { return client.texts.size() == 4; }));
  EXPECT_EQ(client.frames(), 1u);  // no new one yet
  publish();
  EXPECT_TRUE(until([&] { return client.frames() == 2; }));
}

TEST_F(QualisysServer, ReportsChangedBodiesAndKeepsTheirPlaces) {
  start();
  RtClient client(base_ + 1);
  begin(client);
  publish();
  names_ = {"drone"};
  auto without_arm = frame();
  auto model = std::make_shared<SceneModel>();
  model->generation = 2;
  model->bodies = {{2, "drone"}};
  without_arm->model = model;
  server_->publish(without_arm);
  ASSERT_TRUE(until([&] { return client.frames() == 2 && !client.events.empty(); }));
  EXPECT_THAT(client.events, testing::Contains(Event::kCameraSettingsChanged));
  LittleEndianReader in(std::span(client.tcp_frames[1]).subspan(32));
  EXPECT_EQ(in.u32(), 2u);  // still two: the arm as NaN
  (void)in.u32();
  EXPECT_TRUE(std::isnan(in.f32()));
}

TEST_F(QualisysServer, SendsCaptureAndShutdownEventsToEveryClient) {
  start();
  RtClient master(base_ + 1), other(base_ + 1);
  begin(master, "TakeControl open sesame");
  begin(other, "GetParameters 6D");
  master.say("Start");
  ASSERT_TRUE(until([&] { return !other.events.empty(); }));
  EXPECT_EQ(other.events.back(), Event::kCaptureStarted);
  EXPECT_TRUE(master.heard("Starting measurement"));
  server_->stop();
  ASSERT_TRUE(until([&] { return other.closed && master.closed; }));
  EXPECT_EQ(other.events.back(), Event::kShuttingDown);
}

TEST_F(QualisysServer, ReleasesTheControlOfAMasterThatLeaves) {
  start();
  auto first = std::make_unique<RtClient>(base_ + 1);
  begin(*first, "TakeControl open sesame");
  clients_.clear();
  first.reset();
  RtClient second(base_ + 1);
  clients_ = {&second};
  ASSERT_TRUE(until([&] {
    second.say("TakeControl open sesame");
    return second.heard("You are now master") || second.heard("You are already master");
  }));
}

TEST_F(QualisysServer, AnswersDiscoveryUpToALimit) {
  const int asker = bound_socket(SOCK_DGRAM);
  // Port 0 would switch it off: take one that the kernel gives.
  const int probe = bound_socket(SOCK_DGRAM);
  discovery_ = port_of(probe);
  ::close(probe);
  start();
  ASSERT_EQ(server_->second_port(), discovery_);
  RtClient client(base_ + 1);
  clients_ = {&client};
  Bytes question = from_hex("0a000000 07000000");
  BigEndianWriter(question).u16(client.open_udp());
  constexpr std::size_t kAllowed = 64;  // net::AnswerLimiter
  for (std::size_t i = 0; i < 3 * kAllowed; ++i) send_datagram(asker, question, discovery_);
  ASSERT_TRUE(until([&] { return client.udp_frames.size() >= kAllowed; }));
  steps(50);
  ::close(asker);
  EXPECT_EQ(client.udp_frames.size(), kAllowed);
  const std::span<const std::byte> answer = client.udp_frames[0];
  EXPECT_THAT(std::string(decode_text(answer.subspan(8))), HasSubstr("QTM 2.17 (build 4050)"));
  EXPECT_EQ(BigEndianReader(answer.last(2)).u16(), base_);
}

TEST_F(QualisysServer, PublishingAllocatesNothingAfterWarmUp) {
  start();
  RtClient tcp(base_ + 1), udp(base_ + 1), tcp2(base_ + 1), tcp3(base_ + 1);
  begin(tcp2);
  begin(tcp3, "StreamFrames AllFrames 6DEuler");
  begin(tcp);
  begin_udp(udp, "6D 6DRes");
  const auto same = frame();
  // As in the server: from a handler of the io_context, whose memory for operations is recycled.
  int rounds = 0;
  std::uint64_t at_warm = 0;
  std::uint64_t at_end = 0;
  std::function<void()> round = [&] {
    server_->publish(same);
    if (++rounds == 200) at_warm = g_allocations;
    if (rounds == 400) at_end = g_allocations;
    if (rounds < 400) return boost::asio::post(io_, std::ref(round));
    io_.stop();
  };
  boost::asio::post(io_, std::ref(round));
  io_.restart();
  io_.run();  // the clients do not read meanwhile: they would allocate
  EXPECT_EQ(at_end, at_warm);
}

}  // namespace
}  // namespace fiducap::qualisys
