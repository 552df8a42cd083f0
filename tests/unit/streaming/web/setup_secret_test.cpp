// Access to a set-up over real sockets: with its secret, never from foreign pages.
#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>

#include "loopback_client.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/web/http_routes.hpp"
#include "streaming/web/web.hpp"
#include "support/fake_clock.hpp"
#include "support/noted_setup.hpp"
#include "temporary_page.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;

const std::string kSecret(NotedSetup::kSecret);
constexpr const char* kUpgrade =
    "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

class SetupSecretTest : public testing::Test {
 protected:
  SetupSecretTest() {
    WebConfig config;
    config.port = 0;
    config.root = files_.root().string();
    config.hosts = {"hall"};
    WebSources sources;
    sources.setup = &setup_;
    auto started =
        start_web_server(io_, config, std::move(sources), std::make_shared<SceneModel>(), clock_);
    EXPECT_TRUE(started.has_value());
    server_ = std::move(*started);
  }
  LoopbackClient client() { return {io_, server_->port()}; }
  static std::string with(const std::string& secret) {
    return "X-Fiducap-Setup: " + secret + "\r\n";
  }
  /// A request, without its end. Every route has a target of its own.
  static std::string request(const SetupRoute& route, const std::string& headers,
                             const std::string& host = "Host: hall:8080\r\n") {
    const std::string what(route.what == "*" ? "next" : route.what);
    return std::string(route.method) + " /api/v1/setup" + (what.empty() ? "" : "/") + what +
           "?paper=a4 HTTP/1.1\r\n" + host + headers + "\r\n";
  }
  /// The status line and what follows; a connection of its own.
  std::string said(const std::string& request) {
    auto peer = client();
    peer.send(request);
    EXPECT_TRUE(peer.wait_for("\r\n\r\n")) << request;
    clock_.advance(1s);
    return peer.received();
  }
  void use_up_the_budget() {
    auto flood = client();
    for (int i = 0; i < 2 * static_cast<int>(net::RequestLimiter::kBurst); ++i)
      flood.send("GET /healthz HTTP/1.1\r\nHost: hall\r\n\r\n");
    ASSERT_TRUE(flood.wait_for("HTTP/1.1 429"));
  }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  TemporaryPage files_;
  NotedSetup setup_;
  std::unique_ptr<Streamer> server_;
};

TEST_F(SetupSecretTest, EveryRequestWithoutItIsRefused) {
  for (const SetupRoute& route : setup_routes())
    for (const std::string& headers :
         {std::string(), with(""), with("1"), with(kSecret + "0"), with(kSecret.substr(1)),
          "Cookie: setup=" + kSecret + "\r\n"})
      EXPECT_EQ(said(request(route, headers)).rfind("HTTP/1.1 403", 0), 0) << headers;
  EXPECT_EQ(setup_.asked, 0);
}

TEST_F(SetupSecretTest, EverySocketWithoutItIsRefused) {
  for (const SetupRoute& route : setup_routes())
    for (const std::string& wrong : {std::string(), with("1")})
      EXPECT_EQ(said(request(route, wrong + "Connection: Upgrade\r\n" + kUpgrade))
                    .rfind("HTTP/1.1 403", 0),
                0);
  EXPECT_EQ(setup_.asked, 0);
}

TEST_F(SetupSecretTest, AClosedSocketIsNotMistakenForAnother) {
  use_up_the_budget();
  for (const SetupRoute& route : setup_routes())
    for (const std::string& wrong : {std::string(), with("1")})
      client().send(request(route, wrong));  // and closes at once
  clock_.advance(2s);                        // the server reads again
  EXPECT_EQ(said(request({"GET", "", nullptr}, "")).rfind("HTTP/1.1 403", 0), 0)
      << "a later one was answered";
  EXPECT_EQ(setup_.asked, 0);
}

TEST_F(SetupSecretTest, WithItEveryRouteAnswers) {
  int expected = 0;
  for (const SetupRoute& route : setup_routes()) {
    (void)said(request(route, with(kSecret)));
    EXPECT_EQ(setup_.asked, ++expected) << route.what;
  }
}

TEST_F(SetupSecretTest, AFloodOfOthersOfThisMachineDoesNotKeepItOut) {
  auto page = client();
  const auto commands = [&] {
    setup_.said.clear();
    page.received().clear();
    page.send(request({"POST", "*", nullptr}, with(kSecret)));
    EXPECT_TRUE(page.wait_for("HTTP/1.1 202")) << page.received();
    return setup_.said;
  };
  EXPECT_EQ(commands(), "next");
  auto flood = client();
  for (int i = 0; i < 2 * static_cast<int>(net::RequestLimiter::kBurst); ++i)
    flood.send(request({"POST", "*", nullptr}, with("a guess")));
  ASSERT_TRUE(flood.wait_for("HTTP/1.1 429")) << "guesses are limited";
  EXPECT_EQ(commands(), "next");
  auto late = client();
  late.send(request({"POST", "*", nullptr}, with(kSecret)));
  clock_.advance(2s);
  EXPECT_TRUE(late.wait_for("HTTP/1.1 202"));
}

TEST_F(SetupSecretTest, PagesFromElsewhereAreRefusedEvenWithIt) {
  for (const SetupRoute& route : setup_routes()) {
    for (const char* origin :
         {"Origin: http://evil.example\r\n", "Origin: null\r\n", "Origin: http://hall:9999\r\n",
          "Origin: http://hall:8080\r\nOrigin: http://evil.example\r\n"})
      EXPECT_EQ(said(request(route, with(kSecret) + origin)).rfind("HTTP/1.1 403", 0), 0) << origin;
    for (const char* host : {"Host: evil.example\r\n", "Host: [evil.example]\r\n",
                             "Host: 1::%evil.example:8080\r\n", "Host: [1::%evil.example]\r\n"})
      EXPECT_EQ(said(request(route, with(kSecret), host)).rfind("HTTP/1.1 421", 0), 0) << host;
    for (const char* host : {"", "Host: hall\r\nHost: evil.example\r\n"})
      EXPECT_EQ(said(request(route, with(kSecret), host)).rfind("HTTP/1.1 400", 0), 0) << host;
  }
  EXPECT_EQ(setup_.asked, 0);
  (void)said(request(setup_routes()[0], with(kSecret) + "Origin: http://hall:8080\r\n"));
  EXPECT_EQ(setup_.asked, 1) << "its own page";
}

}  // namespace
}  // namespace fiducap::web
