// The token for reading over real sockets: requests, live pages, camera views.
#include <nlohmann/json.hpp>

#include "streaming/net/limits.hpp"
#include "support/control_request.hpp"
#include "support/fake_operator_api.hpp"
#include "support/fake_views.hpp"
#include "support/scene_builder.hpp"
#include "web_server_fixture.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

const std::string kReadToken = "may only look";
// A close by policy (1008), without a reason.
const std::string kRefused = "\x88\x02\x03\xf0";

class ReadTokenTest : public WebServerFixture {
 protected:
  ReadTokenTest() {
    operator_api_.reader_token = kReadToken;
    context_.operator_api = &operator_api_;
    context_.views = &views_;
    config_.camera_views = ViewRule::kEveryone;
    start();
  }
  static std::string bearer(const std::string& token) {
    return "Authorization: Bearer " + token + "\r\n";
  }
  /// The reply to a command at the open socket of `peer`.
  static v1::ControlReply say(LoopbackClient& peer, const std::string& token,
                              const v1::ControlCommand& command) {
    const auto hello = control_reply(peer.next_message().value_or(""));
    peer.say(control_request(token, hello.hello().challenge(), command.SerializeAsString()));
    return control_reply(peer.next_message().value_or(""));
  }
  static v1::ControlReply prove(LoopbackClient& peer, const std::string& token) {
    v1::ControlCommand command;
    command.mutable_list_bodies();
    return say(peer, token, command);
  }

  FakeOperatorApi operator_api_;
  FakeViews views_;
};

TEST_F(ReadTokenTest, RequestsNeedItExceptPageAndHealth) {
  for (const char* path : {"/api/v1/state", "/api/v1/views", "/api/v1/map/versions", "/metrics",
                           "/api/v1/map/diff/1/2", "/api/v1/nothing"}) {
    EXPECT_THAT(get(path), StartsWith("HTTP/1.1 401")) << path;
    clock_.advance(1s);
  }
  EXPECT_THAT(get("/metrics"), HasSubstr("WWW-Authenticate: Bearer\r\n"));
  EXPECT_THAT(get("/api/v1/state", "Authorization: Basic eDp5\r\n"), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(get("/api/v1/state", bearer(kReadToken)), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(get("/metrics", bearer(kReadToken)), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(get("/"), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(get("/healthz"), Not(StartsWith("HTTP/1.1 401")));
  EXPECT_TRUE(operator_api_.refused.empty()) << "nobody has guessed";
  operator_api_.reader_token.clear();
  EXPECT_THAT(get("/api/v1/state"), StartsWith("HTTP/1.1 200"));
}

TEST_F(ReadTokenTest, GuessesAreNotedAndShutTheAddressOut) {
  for (int i = 0; i < net::WrongProofs::kAllowed; ++i)
    EXPECT_THAT(get("/api/v1/state", bearer("a guess")), StartsWith("HTTP/1.1 401"));
  EXPECT_EQ(operator_api_.refused.size(), std::size_t{net::WrongProofs::kAllowed});
  EXPECT_THAT(operator_api_.refused.front(),
              testing::MatchesRegex("127.0.0.1:[0-9]+ \\(web\\) prove a token: wrong token"));
  EXPECT_THAT(get("/api/v1/state", bearer(kReadToken)), StartsWith("HTTP/1.1 429"));
  clock_.advance(net::WrongProofs::kWindow);
  EXPECT_THAT(get("/api/v1/state", bearer(kReadToken)), StartsWith("HTTP/1.1 200"));
}

// A bearer token is sent as it is, so the operator's is not one.
TEST_F(ReadTokenTest, TheOperatorsTokenIsNoBearerToken) {
  EXPECT_THAT(get("/api/v1/state", bearer(operator_api_.operator_token)),
              StartsWith("HTTP/1.1 401"));
}

TEST_F(ReadTokenTest, LivePageProvesEitherTokenAndGetsATicket) {
  for (const std::string& token : {kReadToken, operator_api_.operator_token}) {
    auto peer = upgraded();
    EXPECT_EQ(prove(peer, token).result(), v1::ControlReply::RESULT_DONE) << token;
    const auto first = nlohmann::json::parse(peer.next_message().value_or("{}"));
    EXPECT_EQ(first.value("type", ""), "ticket");
    const std::string ticket = bearer(first.value("ticket", ""));
    EXPECT_THAT(peer.next_message().value_or(""), HasSubstr("\"hello\""));
    EXPECT_THAT(get("/api/v1/state", ticket), StartsWith("HTTP/1.1 200"));
    { const auto gone = std::move(peer); }
    ASSERT_TRUE(run_until(io_, [&] { return clients().empty(); }));
    EXPECT_THAT(get("/api/v1/state", ticket), StartsWith("HTTP/1.1 401")) << "the page is gone";
  }
}

TEST_F(ReadTokenTest, UnprovenLivePageGetsNothingAndHoldsNoPlace) {
  config_.max_clients = 1;
  start();
  auto waiting = upgraded();
  auto guessing = upgraded();
  EXPECT_EQ(prove(guessing, "a guess").result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_TRUE(guessing.wait_for(kRefused));
  auto peer = upgraded();
  EXPECT_EQ(prove(peer, kReadToken).result(), v1::ControlReply::RESULT_DONE);
  EXPECT_THAT(peer.next_message().value_or(""), HasSubstr("ticket"));
  clock_.advance(11s);
  server_->publish(make_scene_frame({"a"}));
  EXPECT_TRUE(waiting.wait_for_close()) << "it has ten seconds";
}

TEST_F(ReadTokenTest, ReaderHasNoCommands) {
  auto peer = upgraded();
  v1::ControlCommand command;
  command.mutable_forget_tag()->set_tag_id(7);
  EXPECT_EQ(say(peer, operator_api_.operator_token, command).result(),
            v1::ControlReply::RESULT_FORBIDDEN);
  path_ = "/api/v1/control";
  auto control = upgraded();
  EXPECT_EQ(say(control, kReadToken, command).result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_TRUE(operator_api_.changes.empty());
}

TEST_F(ReadTokenTest, CameraViewsNeedItAlsoAtTheMachineItself) {
  path_ = "/api/v1/views";
  EXPECT_THAT(get(path_, bearer(kReadToken)), HasSubstr("\"access\":\"proof\""));
  auto peer = upgraded();
  EXPECT_EQ(prove(peer, kReadToken).result(), v1::ControlReply::RESULT_DONE);
  peer.say("1/0/640/10/0", kText);
  EXPECT_TRUE(run_until(io_, [&] { return views_.watched[0].has_value(); }));
  // The rule for operators is not weakened by it.
  config_.camera_views = ViewRule::kOperator;
  start();
  auto remote = upgraded("X-Forwarded-For: 10.0.0.9\r\n");
  EXPECT_EQ(prove(remote, kReadToken).result(), v1::ControlReply::RESULT_FORBIDDEN);
}

TEST_F(ReadTokenTest, ReplacedTokenEndsConnections) {
  auto page = upgraded();
  EXPECT_EQ(prove(page, kReadToken).result(), v1::ControlReply::RESULT_DONE);
  path_ = "/api/v1/views";
  auto viewer = upgraded();
  EXPECT_EQ(prove(viewer, kReadToken).result(), v1::ControlReply::RESULT_DONE);
  operator_api_.reader_token = "another token";
  ++operator_api_.changes_of_tokens;
  clock_.advance(200ms);
  server_->publish(make_scene_frame({"a"}));
  EXPECT_TRUE(page.wait_for_close());
  EXPECT_TRUE(viewer.wait_for_close());
  EXPECT_THAT(get("/api/v1/state", bearer(kReadToken)), StartsWith("HTTP/1.1 401"));
}

}  // namespace
}  // namespace fiducap::web
