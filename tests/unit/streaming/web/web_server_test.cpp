#include "streaming/web/web.hpp"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <nlohmann/json.hpp>
#include <random>

#include "loopback_client.hpp"
#include "streaming/net/limits.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"
#include "temporary_page.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::json;
using testing::Test;

class WebServerTest : public Test {
 protected:
  WebServerTest() { start(); }

  void start() {
    server_.reset();
    config_.port = 0;
    config_.root = files_.root().string();
    config_.hosts = {"hall"};
    WebSources sources;
    sources.version = "0.1.0";
    sources.clients = [this] {
      std::vector<ClientStatus> all;
      if (server_) server_->append_clients(all);
      return all;
    };
    auto started = start_web_server(io_, config_, sources, std::make_shared<SceneModel>(), clock_);
    ASSERT_TRUE(started.has_value()) << started.error().text();
    server_ = std::move(*started);
  }
  LoopbackClient client() { return {io_, server_->port()}; }
  std::string get(const std::string& target) {
    auto peer = client();
    peer.get(target, "Connection: close\r\n");
    EXPECT_TRUE(peer.wait_for_close());
    return peer.received();
  }
  void publish(std::size_t bodies = 3) {
    auto frame = make_scene_frame(std::vector<std::string>(bodies, "body"), ++number_);
    clock_.advance(50ms);
    frame->published_at = clock_.now();
    server_->publish(frame);
  }
  std::vector<ClientStatus> clients() {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }
  void expect_alive() { EXPECT_EQ(get("/").rfind("HTTP/1.1 200", 0), 0); }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  TemporaryPage files_;
  WebConfig config_;
  std::unique_ptr<Streamer> server_;
  std::uint64_t number_{0};
};

TEST_F(WebServerTest, ServesThePageWithItsSecurityPolicy) {
  const std::string answer = get("/");
  EXPECT_EQ(answer.rfind("HTTP/1.1 200 OK\r\n", 0), 0) << answer;
  EXPECT_NE(answer.find("Content-Security-Policy: default-src 'none'"), std::string::npos);
  EXPECT_NE(answer.find("X-Content-Type-Options: nosniff"), std::string::npos);
  EXPECT_NE(answer.find("Content-Length: 34\r\n"), std::string::npos);
  EXPECT_NE(answer.find("\r\n\r\n<!doctype html>"), std::string::npos);
}

TEST_F(WebServerTest, HeadReturnsTheLengthWithoutABody) {
  auto peer = client();
  peer.send("HEAD / HTTP/1.1\r\nHost: hall\r\nConnection: close\r\n\r\n");
  ASSERT_TRUE(peer.wait_for_close());
  EXPECT_NE(peer.received().find("Content-Length: 34\r\n"), std::string::npos);
  EXPECT_EQ(peer.received().find("<!doctype"), std::string::npos);
}

TEST_F(WebServerTest, AnswersManyRequestsOnOneConnection) {
  auto peer = client();
  for (int i = 0; i < 20; ++i) {
    peer.get("/assets/index-1a2b.js");
    ASSERT_TRUE(peer.wait_for("export {};\n")) << i;
    peer.received().clear();
  }
}

TEST_F(WebServerTest, ANameThatOnlyResolvesToThisMachineGetsNothing) {
  for (const std::string target : {"/", "/api/v1/state", "/healthz", "/api/v1/live"}) {
    auto peer = client();
    peer.send("GET " + target +
              " HTTP/1.1\r\nHost: evil.example:8080\r\nOrigin: http://evil.example:8080\r\n"
              "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
              "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
    ASSERT_TRUE(peer.wait_for_close()) << target;
    EXPECT_EQ(peer.received().rfind("HTTP/1.1 421", 0), 0) << peer.received();
    EXPECT_NE(peer.received().find("streaming.web.hosts"), std::string::npos);
  }
}

TEST_F(WebServerTest, UnknownPathIs404) { EXPECT_EQ(get("/nothing").rfind("HTTP/1.1 404", 0), 0); }

TEST_F(WebServerTest, TraversalReachesNothing) {
  for (const char* target :
       {"/../secret.txt", "/assets/../../secret.txt", "/..%2fsecret.txt", "/etc/passwd"}) {
    const std::string answer = get(target);
    EXPECT_EQ(answer.find("outside of the page"), std::string::npos) << target;
    EXPECT_EQ(answer.rfind("HTTP/1.1 4", 0), 0) << target;
  }
}

TEST_F(WebServerTest, OversizeHeaderIsRefusedByName) {
  auto peer = client();
  peer.get("/", "X-Long: " + std::string(100'000, 'a') + "\r\n");
  ASSERT_TRUE(peer.wait_for_close());
  EXPECT_EQ(peer.received().rfind("HTTP/1.1 431", 0), 0);
  expect_alive();
}

TEST_F(WebServerTest, BodyIsRefused) {
  auto peer = client();
  peer.send("POST / HTTP/1.1\r\nHost: hall\r\nContent-Length: 9\r\n\r\n123456789");
  ASSERT_TRUE(peer.wait_for_close());
  EXPECT_EQ(peer.received().rfind("HTTP/1.1 413", 0), 0);
}

TEST_F(WebServerTest, GarbageDoesNoHarm) {
  std::mt19937 random(7);
  for (int i = 0; i < 100; ++i) {
    auto peer = client();
    std::string bytes(1 + random() % 2000, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    peer.send(bytes + "\r\n\r\n");
    peer.received();
    io_.restart();
    io_.run_for(1ms);
  }
  expect_alive();
}

TEST_F(WebServerTest, StateIsJson) {
  publish();
  const std::string answer = get("/api/v1/state");
  const auto state = Json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
  EXPECT_EQ(state["hello"]["version"], "0.1.0");
  EXPECT_EQ(state["frame"]["bodies"].size(), 3);
}

TEST_F(WebServerTest, StateIsCompressedForWhoTakesThat) {
  publish(30);
  auto peer = client();
  peer.get("/api/v1/state", "Accept-Encoding: gzip\r\nConnection: close\r\n");
  ASSERT_TRUE(peer.wait_for_close());
  const std::string& answer = peer.received();
  EXPECT_NE(answer.find("Content-Encoding: gzip\r\n"), std::string::npos) << answer.substr(0, 500);
  EXPECT_NE(answer.find("Vary: Accept-Encoding\r\n"), std::string::npos);
  EXPECT_EQ(answer.substr(answer.find("\r\n\r\n") + 4, 2), "\x1f\x8b");
  EXPECT_LT(answer.size() * 3, get("/api/v1/state").size());
}

TEST_F(WebServerTest, MetricsAreServed) {
  publish();
  EXPECT_NE(get("/metrics").find("\nfiducap_frames_published_total 1\n"), std::string::npos);
}

TEST_F(WebServerTest, TooFrequentRequestsGet429AndAreReadNoFurther) {
  publish();
  auto flood = client();
  const std::string request = "GET /healthz HTTP/1.1\r\nHost: hall\r\n\r\n";
  std::string all;
  for (int i = 0; i < 1000; ++i) all += request;
  flood.send(all);
  ASSERT_TRUE(flood.wait_for("HTTP/1.1 429"));
  EXPECT_NE(flood.received().find("Retry-After: 1\r\n"), std::string::npos);
  const auto count = [&](const std::string& word) {
    int found = 0;
    for (auto at = flood.received().find(word); at != std::string::npos;
         at = flood.received().find(word, at + 1))
      ++found;
    return found;
  };
  EXPECT_EQ(count("HTTP/1.1 200"), static_cast<int>(net::RequestLimiter::kBurst));
  io_.restart();
  io_.run_for(1ms);
  EXPECT_EQ(count("HTTP/1.1 429"), 1);
  auto late = client();
  late.send(request);
  clock_.advance(2s);
  ASSERT_TRUE(late.wait_for("HTTP/1.1 200")) << "a connection of the same address waits its turn";
}

TEST_F(WebServerTest, AFloodOfOneAddressLeavesTheOthersTheirRequests) {
  auto flood = client();
  for (int i = 0; i < 200; ++i) flood.send("GET / HTTP/1.1\r\nHost: hall\r\n\r\n");
  ASSERT_TRUE(flood.wait_for("HTTP/1.1 429"));
  LoopbackClient other(io_, server_->port(), 0, "127.0.0.2");
  other.get("/", "Connection: close\r\n");
  ASSERT_TRUE(other.wait_for_close());
  EXPECT_EQ(other.received().rfind("HTTP/1.1 200", 0), 0);
}

TEST_F(WebServerTest, OneAddressDoesNotKeepAllLivePagesFromOthers) {
  config_.max_clients = 3;
  start();
  std::vector<std::unique_ptr<LoopbackClient>> greedy;
  for (std::size_t i = 0; i < 3; ++i) {
    greedy.push_back(std::make_unique<LoopbackClient>(io_, server_->port()));
    greedy.back()->upgrade();
    ASSERT_TRUE(greedy.back()->wait_for_upgrade());
    ASSERT_TRUE(run_until(io_, [&] { return clients().size() == i + 1; }));
  }
  LoopbackClient other(io_, server_->port(), 0, "127.0.0.2");
  other.upgrade();
  ASSERT_TRUE(other.wait_for_upgrade()) << other.received();
  EXPECT_TRUE(greedy.back()->wait_for_close());
  EXPECT_FALSE(greedy.front()->closed());
  EXPECT_EQ(clients().size(), 3u);
}

TEST_F(WebServerTest, HealthIsBadUntilFramesFlow) {
  EXPECT_EQ(get("/healthz").rfind("HTTP/1.1 503", 0), 0);
  publish();
  EXPECT_EQ(get("/healthz").rfind("HTTP/1.1 200", 0), 0);
}

TEST_F(WebServerTest, LiveSocketSpeaksHelloMapAndFrames) {
  publish();
  auto page = client();
  page.upgrade("Origin: http://hall:8080\r\n");
  ASSERT_TRUE(page.wait_for_upgrade()) << page.received();
  for (const char* expected : {"hello", "map", "frame", "clients"}) {
    const auto message = page.next_message();
    ASSERT_TRUE(message.has_value()) << expected;
    EXPECT_EQ(Json::parse(*message)["type"], expected);
  }
  ASSERT_TRUE(page.next_message().has_value());  // the log, which began with the server's own line
  publish();
  EXPECT_EQ(Json::parse(*page.next_message())["number"], 2);
  ASSERT_EQ(clients().size(), 1);
  EXPECT_EQ(clients()[0].frames_sent, 2);
}

TEST_F(WebServerTest, LiveSocketIsRefusedToAForeignPage) {
  auto page = client();
  page.upgrade("Origin: http://elsewhere\r\n");
  ASSERT_TRUE(page.wait_for_close());
  EXPECT_EQ(page.received().rfind("HTTP/1.1 403", 0), 0);
  EXPECT_TRUE(clients().empty());
}

TEST_F(WebServerTest, OnePageAboveTheLimitGets503) {
  config_.max_clients = 1;
  start();
  auto first = client();
  first.upgrade();
  ASSERT_TRUE(first.wait_for_upgrade());
  ASSERT_TRUE(run_until(io_, [&] { return clients().size() == 1; }));
  auto second = client();
  second.upgrade();
  ASSERT_TRUE(second.wait_for_close());
  EXPECT_EQ(second.received().rfind("HTTP/1.1 503", 0), 0);
}

TEST_F(WebServerTest, PageThatLeavesMakesRoom) {
  {
    auto page = client();
    page.upgrade();
    ASSERT_TRUE(page.wait_for_upgrade());
    ASSERT_TRUE(run_until(io_, [&] { return clients().size() == 1; }));
  }
  EXPECT_TRUE(run_until(io_, [&] { return clients().empty(); }));
}

TEST_F(WebServerTest, PageThatTalksIsClosed) {
  auto page = client();
  page.upgrade();
  ASSERT_TRUE(page.wait_for_upgrade());
  page.send(std::string("\x81\x82\x01\x02\x03\x04hi", 8));  // a masked text of two bytes
  EXPECT_TRUE(page.wait_for_close());
  EXPECT_TRUE(clients().empty());
}

TEST_F(WebServerTest, ASlowReaderLosesFramesThenItsConnectionWithoutEffectOnOthers) {
  LoopbackClient slow(io_, server_->port(), 4096);
  slow.upgrade();
  ASSERT_TRUE(run_until(io_, [&] { return clients().size() == 1; }));
  auto quick = client();
  quick.upgrade();
  ASSERT_TRUE(quick.wait_for_upgrade());
  // 300 bodies are about 100 kB a frame: a hundred of them fill any buffer on the way.
  for (int i = 0; i < 100 && clients()[0].frames_dropped == 0; ++i) {
    publish(300);
    const std::string newest = "\"number\":" + std::to_string(number_) + ",";
    ASSERT_TRUE(run_until(io_, [&] {
      const auto message = quick.next_message();
      return message && message->find(newest) != std::string::npos;
    })) << i;
  }
  ASSERT_EQ(clients().size(), 2);
  EXPECT_GT(clients()[0].frames_dropped, 0);
  EXPECT_EQ(clients()[1].frames_dropped, 0);
  clock_.advance(6s);
  publish(1);
  EXPECT_EQ(clients().size(), 1);
}

TEST_F(WebServerTest, SilentConnectionsAreBoundedAndThePageStaysReachable) {
  config_.max_clients = 1;
  start();
  std::vector<std::unique_ptr<LoopbackClient>> silent;
  for (int i = 0; i < 80; ++i)
    silent.push_back(std::make_unique<LoopbackClient>(io_, server_->port()));
  EXPECT_TRUE(run_until(io_, [&] { return silent.back()->closed(); }))
      << "connection 80 of at most 65 stays open";
  EXPECT_FALSE(silent.front()->closed());
  silent.erase(silent.begin(), silent.begin() + 40);
  io_.restart();
  io_.run_for(1ms);
  expect_alive();
}

TEST_F(WebServerTest, PortInUseIsAnErrorWithARemedy) {
  config_.port = server_->port();
  const auto second = start_web_server(io_, config_, {}, std::make_shared<SceneModel>(), clock_);
  ASSERT_FALSE(second.has_value());
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(second.error().text().find("streaming.web.port"), std::string::npos);
  EXPECT_NE(second.error().text().find(std::to_string(config_.port)), std::string::npos);
}

TEST_F(WebServerTest, AddressThatIsNoneIsAnError) {
  config_.address = "the hall";
  EXPECT_FALSE(
      start_web_server(io_, config_, {}, std::make_shared<SceneModel>(), clock_).has_value());
}

TEST_F(WebServerTest, StopEndsEveryConnectionAndTheLoop) {
  auto page = client();
  page.upgrade();
  ASSERT_TRUE(page.wait_for_upgrade());
  auto idle = client();
  ASSERT_TRUE(run_until(io_, [&] { return clients().size() == 1; }));
  server_->stop();
  EXPECT_TRUE(page.wait_for_close());
  EXPECT_TRUE(idle.wait_for_close());
  io_.restart();
  io_.run_for(1s);
  EXPECT_TRUE(io_.stopped()) << "something still waits";
}

}  // namespace
}  // namespace fiducap::web
