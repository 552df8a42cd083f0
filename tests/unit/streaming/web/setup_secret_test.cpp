// Access to a set-up over real sockets: with its secret, never from foreign pages.
#include "streaming/net/limits.hpp"
#include "streaming/web/http_routes.hpp"
#include "support/noted_setup.hpp"
#include "web_server_fixture.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using testing::StartsWith;

const std::string kSecret(NotedSetup::kSecret);

class SetupSecretTest : public WebServerFixture {
 protected:
  SetupSecretTest() {
    context_.setup = &setup_;
    start();
  }
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
  /// The answer to a request on a connection of its own.
  std::string answer(const std::string& request) {
    auto peer = client();
    peer.send(request);
    EXPECT_TRUE(peer.wait_for("\r\n\r\n")) << request;
    clock_.advance(1s);
    return peer.received();
  }
  /// A client that has reached the limit of requests.
  LoopbackClient flooding(const std::string& request) {
    auto peer = client();
    for (int i = 0; i < 2 * static_cast<int>(net::RequestLimiter::kBurst); ++i) peer.send(request);
    EXPECT_TRUE(peer.wait_for("HTTP/1.1 429"));
    return peer;
  }
  NotedSetup setup_;
};

TEST_F(SetupSecretTest, RequestsAndSocketsWithoutItAreRefused) {
  for (const SetupRoute& route : setup_routes()) {
    for (const std::string& headers :
         {std::string(), with(""), with("1"), with(kSecret + "0"), with(kSecret.substr(1)),
          "Cookie: setup=" + kSecret + "\r\n", kUpgrade, with("1") + kUpgrade})
      EXPECT_THAT(answer(request(route, headers)), StartsWith("HTTP/1.1 403")) << headers;
  }
  EXPECT_EQ(setup_.asked, 0);
}

TEST_F(SetupSecretTest, ClosedConnectionIsNotMistakenForAnother) {
  (void)flooding("GET /healthz HTTP/1.1\r\nHost: hall\r\n\r\n");
  for (const SetupRoute& route : setup_routes())
    for (const std::string& wrong : {std::string(), with("1")})
      client().send(request(route, wrong));  // and closes at once
  clock_.advance(2s);                        // the server reads again
  EXPECT_THAT(answer(request({"GET", "", nullptr}, "")), StartsWith("HTTP/1.1 403"));
  EXPECT_EQ(setup_.asked, 0);
}

TEST_F(SetupSecretTest, AdmitsToEveryRoute) {
  int expected = 0;
  for (const SetupRoute& route : setup_routes()) {
    (void)answer(request(route, with(kSecret)));
    EXPECT_EQ(setup_.asked, ++expected) << route.what;
  }
}

TEST_F(SetupSecretTest, FloodOfOtherLocalClientsDoesNotExcludeIt) {
  const std::string next = request({"POST", "*", nullptr}, with(kSecret));
  auto page = client();
  const auto commands = [&] {
    setup_.said.clear();
    page.received().clear();
    page.send(next);
    EXPECT_TRUE(page.wait_for("HTTP/1.1 202")) << page.received();
    return setup_.said;
  };
  EXPECT_EQ(commands(), "next");
  const auto guessing = flooding(request({"POST", "*", nullptr}, with("a guess")));
  EXPECT_EQ(commands(), "next");
  auto late = client();
  late.send(next);
  clock_.advance(2s);
  EXPECT_TRUE(late.wait_for("HTTP/1.1 202"));
}

TEST_F(SetupSecretTest, PagesOfOtherOriginsAreRefusedEvenWithIt) {
  for (const SetupRoute& route : setup_routes()) {
    for (const char* origin :
         {"Origin: http://evil.example\r\n", "Origin: null\r\n", "Origin: http://hall:9999\r\n",
          "Origin: http://hall:8080\r\nOrigin: http://evil.example\r\n"})
      EXPECT_THAT(answer(request(route, with(kSecret) + origin)), StartsWith("HTTP/1.1 403"))
          << origin;
    for (const char* host : {"Host: evil.example\r\n", "Host: [evil.example]\r\n",
                             "Host: 1::%evil.example:8080\r\n", "Host: [1::%evil.example]\r\n"})
      EXPECT_THAT(answer(request(route, with(kSecret), host)), StartsWith("HTTP/1.1 421")) << host;
    for (const char* host : {"", "Host: hall\r\nHost: evil.example\r\n"})
      EXPECT_THAT(answer(request(route, with(kSecret), host)), StartsWith("HTTP/1.1 400")) << host;
  }
  EXPECT_EQ(setup_.asked, 0);
  (void)answer(request(setup_routes()[0], with(kSecret) + "Origin: http://hall:8080\r\n"));
  EXPECT_EQ(setup_.asked, 1) << "its own page";
}

}  // namespace
}  // namespace fiducap::web
