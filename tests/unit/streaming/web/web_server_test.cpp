#include "streaming/web/web.hpp"

#include <deque>
#include <nlohmann/json.hpp>

#include "streaming/net/limits.hpp"
#include "support/scene_builder.hpp"
#include "web_server_fixture.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::json;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class WebServerTest : public WebServerFixture {
 protected:
  WebServerTest() {
    context_.version = "0.1.0";
    context_.clients = [this] { return server_ ? clients() : std::vector<ClientStatus>{}; };
    start();
  }
  void publish(std::size_t bodies = 3) {
    auto frame = make_scene_frame(std::vector<std::string>(bodies, "body"), ++number_);
    clock_.advance(50ms);
    frame->published_at = clock_.now();
    server_->publish(frame);
  }
  /// An open page that the server lists.
  LoopbackClient page(int receive_buffer = 0) {
    const auto before = clients().size();
    auto opened = upgraded("", "127.0.0.1", receive_buffer);
    EXPECT_TRUE(run_until(io_, [&] { return clients().size() == before + 1; }));
    return opened;
  }
  /// The answer to a request after which the server closes the connection.
  static std::string last_answer(LoopbackClient peer) {
    EXPECT_TRUE(peer.wait_for_close());
    return peer.received();
  }
  std::string answer(const std::string& request) {
    auto peer = client();
    peer.send(request);
    return last_answer(std::move(peer));
  }
  void expect_alive() { EXPECT_THAT(get("/"), StartsWith("HTTP/1.1 200")); }

  std::uint64_t number_{0};
};

TEST_F(WebServerTest, ServesThePageWithItsSecurityPolicy) {
  const std::string page = get("/");
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_THAT(page, HasSubstr("Content-Security-Policy: default-src 'none'"));
  EXPECT_THAT(page, HasSubstr("X-Content-Type-Options: nosniff"));
  EXPECT_THAT(page, HasSubstr("Content-Length: 34\r\n"));
  EXPECT_THAT(page, HasSubstr("\r\n\r\n<!doctype html>"));
  const std::string head = answer("HEAD / HTTP/1.1\r\nHost: hall\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(head, HasSubstr("Content-Length: 34\r\n"));
  EXPECT_THAT(head, Not(HasSubstr("<!doctype")));
}

TEST_F(WebServerTest, AnswersManyRequestsOnOneConnection) {
  auto peer = client();
  for (int i = 0; i < 20; ++i) {
    peer.get("/assets/index-1a2b.js");
    ASSERT_TRUE(peer.wait_for("export {};\n")) << i;
    peer.received().clear();
  }
}

TEST_F(WebServerTest, RefusesForeignHostNames) {
  for (const std::string target : {"/", "/api/v1/state", "/healthz", "/api/v1/live"}) {
    const std::string refused =
        answer("GET " + target +
               " HTTP/1.1\r\nHost: evil.example:8080\r\nOrigin: http://evil.example:8080\r\n" +
               kUpgrade + "\r\n");
    EXPECT_THAT(refused, StartsWith("HTTP/1.1 421")) << target;
    EXPECT_THAT(refused, HasSubstr("streaming.web.hosts"));
  }
}

TEST_F(WebServerTest, RefusesInvalidRequestsByTheirStatus) {
  EXPECT_THAT(get("/nothing"), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(get("/../secret.txt"), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(get("/", "X-Long: " + std::string(100'000, 'a') + "\r\n"),
              StartsWith("HTTP/1.1 431"));
  EXPECT_THAT(answer("POST / HTTP/1.1\r\nHost: hall\r\nContent-Length: 9\r\n\r\n123456789"),
              StartsWith("HTTP/1.1 413"));
  expect_alive();
}

TEST_F(WebServerTest, ServesHealthStateAndMetrics) {
  EXPECT_THAT(get("/healthz"), StartsWith("HTTP/1.1 503"));
  publish();
  EXPECT_THAT(get("/healthz"), StartsWith("HTTP/1.1 200"));
  const std::string state = get("/api/v1/state");
  const auto json = Json::parse(state.substr(state.find("\r\n\r\n") + 4));
  EXPECT_EQ(json["hello"]["version"], "0.1.0");
  EXPECT_EQ(json["frame"]["bodies"].size(), 3);
  EXPECT_THAT(get("/metrics"), HasSubstr("\nfiducap_frames_published_total 1\n"));
}

TEST_F(WebServerTest, CompressesTheStateOnRequest) {
  publish(30);
  const std::string zipped = get("/api/v1/state", "Accept-Encoding: gzip\r\n");
  EXPECT_THAT(zipped, HasSubstr("Content-Encoding: gzip\r\n"));
  EXPECT_THAT(zipped, HasSubstr("Vary: Accept-Encoding\r\n"));
  EXPECT_EQ(zipped.substr(zipped.find("\r\n\r\n") + 4, 2), "\x1f\x8b");
  EXPECT_LT(zipped.size() * 3, get("/api/v1/state").size());
}

TEST_F(WebServerTest, TooFrequentRequestsGet429AndExcludeNoOtherAddress) {
  publish();
  auto flood = client();
  const std::string request = "GET /healthz HTTP/1.1\r\nHost: hall\r\n\r\n";
  std::string all;
  for (int i = 0; i < 1000; ++i) all += request;
  flood.send(all);
  ASSERT_TRUE(flood.wait_for("HTTP/1.1 429"));
  EXPECT_THAT(flood.received(), HasSubstr("Retry-After: 1\r\n"));
  const auto count = [&](const std::string& status) {
    int found = 0;
    for (auto at = flood.received().find(status); at != std::string::npos;
         at = flood.received().find(status, at + 1))
      ++found;
    return found;
  };
  EXPECT_EQ(count("HTTP/1.1 200"), static_cast<int>(net::RequestLimiter::kBurst));
  io_.restart();
  io_.run_for(1ms);
  EXPECT_EQ(count("HTTP/1.1 429"), 1) << "the others are not read";
  auto other = client("127.0.0.2");
  other.get("/", "Connection: close\r\n");
  EXPECT_THAT(last_answer(std::move(other)), StartsWith("HTTP/1.1 200"));
  auto late = client();
  late.send(request);
  clock_.advance(2s);
  ASSERT_TRUE(late.wait_for("HTTP/1.1 200")) << "another connection of this address";
}

TEST_F(WebServerTest, AddressWithAllPagesYieldsOneToAnother) {
  config_.max_clients = 3;
  start();
  std::vector<LoopbackClient> greedy;
  for (std::size_t i = 0; i < 3; ++i) greedy.push_back(page());
  const auto other = upgraded("", "127.0.0.2");
  EXPECT_TRUE(greedy.back().wait_for_close());
  EXPECT_FALSE(greedy.front().closed());
  EXPECT_EQ(clients().size(), 3u);
}

TEST_F(WebServerTest, LiveSocketSendsHelloMapAndFrames) {
  publish();
  auto page = upgraded("Origin: http://hall:8080\r\n");
  for (const char* expected : {"hello", "map", "frame", "clients"}) {
    const auto message = page.next_message();
    ASSERT_TRUE(message.has_value()) << expected;
    EXPECT_EQ(Json::parse(*message)["type"], expected);
  }
  ASSERT_TRUE(page.next_message().has_value());  // the log with the server's first line
  publish();
  EXPECT_EQ(Json::parse(*page.next_message())["number"], 2);
  ASSERT_EQ(clients().size(), 1);
  EXPECT_EQ(clients()[0].frames_sent, 2);
}

TEST_F(WebServerTest, RefusesPagesOfOtherOriginsAndAboveTheLimit) {
  config_.max_clients = 1;
  start();
  EXPECT_THAT(last_answer(upgrading("Origin: http://elsewhere\r\n")), StartsWith("HTTP/1.1 403"));
  EXPECT_TRUE(clients().empty());
  const auto first = page();
  EXPECT_THAT(last_answer(upgrading()), StartsWith("HTTP/1.1 503"));
}

TEST_F(WebServerTest, RemovesPagesThatLeaveOrSend) {
  { const auto leaves = page(); }
  EXPECT_TRUE(run_until(io_, [&] { return clients().empty(); }));
  auto sends = upgraded();
  sends.send(std::string("\x81\x82\x01\x02\x03\x04hi", 8));  // a masked text of two bytes
  EXPECT_TRUE(sends.wait_for_close());
  EXPECT_TRUE(clients().empty());
}

TEST_F(WebServerTest, SlowReaderLosesFramesThenItsConnection) {
  const auto slow = page(4096);
  auto quick = upgraded();
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
  EXPECT_EQ(clients()[1].frames_dropped, 0) << "the other page";
  clock_.advance(6s);
  publish(1);
  EXPECT_EQ(clients().size(), 1);
}

TEST_F(WebServerTest, LimitsSilentConnectionsAndStaysReachable) {
  config_.max_clients = 1;
  start();
  std::deque<LoopbackClient> silent;
  for (int i = 0; i < 80; ++i) silent.push_back(client());
  EXPECT_TRUE(run_until(io_, [&] { return silent.back().closed(); }))
      << "connection 80 of at most 65 stays open";
  EXPECT_FALSE(silent.front().closed());
  for (int i = 0; i < 40; ++i) silent.pop_front();
  io_.restart();
  io_.run_for(1ms);
  expect_alive();
}

TEST_F(WebServerTest, StopEndsAllConnectionsAndTheLoop) {
  auto live = page();
  auto idle = client();
  server_->stop();
  EXPECT_TRUE(live.wait_for_close());
  EXPECT_TRUE(idle.wait_for_close());
  io_.restart();
  io_.run_for(1s);
  EXPECT_TRUE(io_.stopped()) << "a handler still waits";
}

}  // namespace
}  // namespace fiducap::web
