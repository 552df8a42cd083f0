#include "streaming/qualisys/qualisys.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <boost/asio/post.hpp>
#include <chrono>
#include <functional>

#include "base/bytes.hpp"
#include "fake_operator_api.hpp"
#include "rt_client.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "support/server_stage.hpp"

namespace fiducap::qualisys {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

class QualisysServer : public ServerStage<RtClient> {
 protected:
  ~QualisysServer() override {
    if (server_) server_->stop();
    io_.restart();
    io_.run();
  }
  void start() {
    config_.base_port = 0;
    config_.discovery_port = discovery_;
    auto server = start_qualisys_server(io_, config_, &operator_api_,
                                        make_scene_frame(names_)->model, clock_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    base_ = server_->base_port();
  }
  void publish() { server_->publish(frame()); }
  /// Speaks version 1.28 and asks for a stream.
  void begin(RtClient& client, const std::string& stream) {
    clients_.push_back(&client);
    client.say("Version 1.28");
    client.say(stream);
    client.say("ByteOrder");
    ASSERT_TRUE(until([&] { return client.texts.size() >= 3; }));
  }
  [[nodiscard]] std::vector<ClientStatus> status() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  FakeOperatorApi operator_api_;
  QualisysConfig config_;
  std::uint16_t discovery_{0};
  std::uint16_t base_{0};
  std::unique_ptr<QualisysStreamer> server_;
};

TEST_F(QualisysServer, StreamsByTcpInBothByteOrders) {
  start();
  RtClient little(base_ + 1);
  RtClient big(base_ + 2, std::endian::big);
  begin(little, "StreamFrames AllFrames 6D");
  begin(big, "StreamFrames AllFrames 6D");
  EXPECT_TRUE(little.heard("QTM RT Interface connected"));
  EXPECT_TRUE(big.heard("Byte order is big endian"));
  publish();
  ASSERT_TRUE(until([&] { return little.frames() == 1 && big.frames() == 1; }));
  LittleEndianReader a(std::span(little.tcp_frames[0]).subspan(40));
  BigEndianReader b(std::span(big.tcp_frames[0]).subspan(40));
  EXPECT_EQ(a.f32(), 1000.0F);
  EXPECT_EQ(b.f32(), 1000.0F);
}

TEST_F(QualisysServer, StreamsByUdpToEveryClientThatAsked) {
  start();
  RtClient a(base_ + 1);
  RtClient b(base_ + 1);
  begin(a, "StreamFrames AllFrames UDP:" + std::to_string(a.open_udp()) + " 6DEuler");
  begin(b, "StreamFrames AllFrames UDP:" + std::to_string(b.open_udp()) + " 6DEuler");
  for (int i = 0; i < 3; ++i) publish();
  ASSERT_TRUE(until([&] { return a.udp_frames.size() == 3 && b.udp_frames.size() == 3; }));
  EXPECT_THAT(a.tcp_frames, IsEmpty());
  EXPECT_EQ(a.udp_frames, b.udp_frames);
  EXPECT_THAT(status().at(0).peer, HasSubstr("udp"));
  EXPECT_EQ(status().at(0).frames_sent, 3u);
  EXPECT_EQ(status().at(0).frames_dropped, 0u);
}

TEST_F(QualisysServer, AUdpReceiverThatIsGoneCostsTheOthersNothing) {
  start();
  RtClient gone(base_ + 1);
  RtClient here(base_ + 1);
  begin(gone,
        "StreamFrames AllFrames UDP:" + std::to_string(base_) + " 6D");  // TCP's: no UDP there
  begin(here, "StreamFrames AllFrames UDP:" + std::to_string(here.open_udp()) + " 6D");
  for (int i = 0; i < 20; ++i) {
    publish();
    step();
  }
  EXPECT_TRUE(until([&] { return here.udp_frames.size() == 20; }));
}

TEST_F(QualisysServer, GivesTheCurrentFrameOnceEach) {
  start();
  publish();
  RtClient client(base_ + 1);
  begin(client, "GetCurrentFrame 6D");
  ASSERT_TRUE(until([&] { return client.frames() == 1; }));
  client.say("GetCurrentFrame 6D");
  client.say("QTMVersion");
  ASSERT_TRUE(until([&] { return client.texts.size() == 4; }));
  EXPECT_EQ(client.frames(), 1);  // no new one yet
  publish();
  EXPECT_TRUE(until([&] { return client.frames() == 2; }));
}

TEST_F(QualisysServer, ReportsChangedBodiesAndKeepsTheirPlaces) {
  start();
  RtClient client(base_ + 1);
  begin(client, "StreamFrames AllFrames 6D");
  publish();
  names_ = {"drone"};
  auto without_arm = frame();
  auto model = std::make_shared<SceneModel>();
  model->generation = 2;
  model->bodies = {{2, "drone"}};
  without_arm->model = model;
  server_->publish(without_arm);
  ASSERT_TRUE(until([&] { return client.frames() == 2 && !client.events.empty(); }));
  EXPECT_THAT(client.events, Contains(Event::kCameraSettingsChanged));
  LittleEndianReader in(std::span(client.tcp_frames[1]).subspan(32));
  EXPECT_EQ(in.u32(), 2u);  // still two: the arm as NaN
  (void)in.u32();
  EXPECT_TRUE(std::isnan(in.f32()));
}

TEST_F(QualisysServer, SendsCaptureAndShutdownEventsToEveryClient) {
  start();
  RtClient master(base_ + 1);
  RtClient other(base_ + 1);
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

TEST_F(QualisysServer, AMasterThatLeavesFreesTheControl) {
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

TEST_F(QualisysServer, AClientThatDoesNotReadLosesFramesAndStaysBounded) {
  names_.assign(200, "body");
  start();
  RtClient lazy(base_ + 1);
  RtClient eager(base_ + 1);
  begin(lazy, "StreamFrames AllFrames All");
  begin(eager, "StreamFrames AllFrames All");
  clients_ = {&eager};
  for (int i = 0; i < 500; ++i) {
    publish();
    step();
  }
  ASSERT_TRUE(until([&] { return eager.frames() == 500; }));
  const auto all = status();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_GT(all[0].frames_dropped, 0u);
  EXPECT_EQ(all[1].frames_dropped, 0u);
}

TEST_F(QualisysServer, GarbageEndsOnlyItsSender) {
  start();
  RtClient good(base_ + 1);
  RtClient bad(base_ + 1);
  begin(good, "StreamFrames AllFrames 6D");
  clients_.push_back(&bad);
  bad.send(from_hex("ffffffffffffffffffffffff"));
  ASSERT_TRUE(until([&] { return bad.closed; }));
  publish();
  EXPECT_TRUE(until([&] { return good.frames() == 1; }));
}

TEST_F(QualisysServer, WhoSaysNothingIsSentAway) {
  start();
  RtClient silent(base_ + 1);
  RtClient speaking(base_ + 1);
  clients_ = {&silent};
  begin(speaking, "StreamFrames Stop");  // no answer, then two
  clock_.advance(std::chrono::seconds(11));
  EXPECT_TRUE(until([&] { return silent.closed; }));
  EXPECT_FALSE(speaking.closed);
}

TEST_F(QualisysServer, HasPlacesForSoManyAndNoMore) {
  config_.max_clients = 3;
  config_.max_clients_per_address = 2;
  start();
  RtClient a(base_ + 1);
  RtClient b(base_ + 1);
  RtClient c(base_ + 1);
  clients_ = {&a, &b, &c};
  EXPECT_TRUE(until([&] { return c.closed && !a.texts.empty() && !b.texts.empty(); }));
}

TEST_F(QualisysServer, AnswersWhoIsThereButNotAFlood) {
  // Port 0 would switch it off: take one that the kernel gives.
  const int probe = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(own);
  ::bind(probe, reinterpret_cast<const sockaddr*>(&own), size);
  ::getsockname(probe, reinterpret_cast<sockaddr*>(&own), &size);
  ::close(probe);
  discovery_ = ntohs(own.sin_port);
  start();
  ASSERT_EQ(server_->discovery_port(), discovery_);
  RtClient client(base_ + 1);
  clients_ = {&client};
  const std::uint16_t reply = client.open_udp();
  std::vector<std::byte> question = from_hex("0a000000 07000000");
  question.push_back(static_cast<std::byte>(reply >> 8));
  question.push_back(static_cast<std::byte>(reply & 0xff));
  const int asker = ::socket(AF_INET, SOCK_DGRAM, 0);
  constexpr std::size_t kAllowed = 64;  // net::AnswerLimiter
  for (std::size_t i = 0; i < 3 * kAllowed; ++i) {
    ::sendto(asker, question.data(), question.size(), 0, reinterpret_cast<const sockaddr*>(&own),
             sizeof(own));
  }
  ASSERT_TRUE(until([&] { return client.udp_frames.size() >= kAllowed; }));
  for (int i = 0; i < 50; ++i) step();
  ::close(asker);
  EXPECT_EQ(client.udp_frames.size(), kAllowed);
  const auto& answer = client.udp_frames[0];
  EXPECT_THAT(std::string(decode_text(std::span(answer).subspan(8))),
              HasSubstr("QTM 2.17 (build 4050)"));
  BigEndianReader port{std::span<const std::byte>(answer).last(2)};
  EXPECT_EQ(port.u16(), base_);
}

TEST_F(QualisysServer, NamesPortAndRemedyWhenThePortIsInUse) {
  start();
  QualisysConfig second = config_;
  second.base_port = base_;
  const auto server =
      start_qualisys_server(io_, second, &operator_api_, make_scene_frame(names_)->model, clock_);
  ASSERT_FALSE(server);
  EXPECT_THAT(server.error().text(), HasSubstr(std::to_string(base_)));
  EXPECT_THAT(server.error().text(), HasSubstr("streaming.qualisys.base_port"));
}

TEST_F(QualisysServer, PublishingAllocatesNothingAfterWarmUp) {
  start();
  RtClient tcp(base_ + 1);
  RtClient udp(base_ + 1);
  RtClient tcp2(base_ + 1);
  RtClient tcp3(base_ + 1);
  begin(tcp2, "StreamFrames AllFrames 6D");
  begin(tcp3, "StreamFrames AllFrames 6DEuler");
  begin(tcp, "StreamFrames AllFrames 6D");
  begin(udp, "StreamFrames AllFrames UDP:" + std::to_string(udp.open_udp()) + " 6D 6DRes");
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
