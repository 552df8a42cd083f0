// Pictures of cameras over real sockets: access, content, hostile clients.
#include "streaming/web/view_feed.hpp"

#include "support/control_request.hpp"
#include "support/fake_operator_api.hpp"
#include "support/fake_views.hpp"
#include "support/scene_builder.hpp"
#include "web_server_fixture.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

// A close by policy (1008), without a reason.
const std::string kClosed = "\x88\x02\x03\xf0";
// A proxy on this machine forwards requests of other machines.
constexpr const char* kProxied = "X-Forwarded-For: 10.0.0.9\r\n";

class ViewSocketTest : public WebServerFixture {
 protected:
  ViewSocketTest() {
    path_ = "/api/v1/views";
    context_.operator_api = &operator_api_;
    context_.views = &views_;
    start(ViewRule::kOperator);
  }
  void start(ViewRule rule) {
    config_.camera_views = rule;
    WebServerFixture::start();
  }
  static void say(LoopbackClient& peer, const std::string& text) { peer.say(text, kText); }
  /// Waits until the server has processed it.
  bool is_watched(std::size_t camera) {
    return run_until(io_, [&] { return views_.watched[camera].has_value(); });
  }
  bool is_unwatched(std::size_t camera) {
    return run_until(io_, [&] { return !views_.watched[camera].has_value(); });
  }
  void make(std::size_t camera, const std::string& text) {
    clock_.advance(200ms);
    views_.make(camera, text);
    server_->publish(make_scene_frame({"a"}));
  }
  static v1::ControlReply reply(LoopbackClient& peer) {
    return control_reply(peer.next_message().value_or(""));
  }
  /// Replies to the challenge of a proxied viewer.
  static void prove(LoopbackClient& peer, const std::string& token) {
    v1::ControlCommand command;
    command.mutable_list_bodies();
    peer.say(control_request(token, reply(peer).hello().challenge(), command.SerializeAsString()));
  }
  /// A local viewer of the first camera.
  LoopbackClient watching() {
    auto peer = upgraded();
    say(peer, "1/0/640/10/0");
    EXPECT_TRUE(is_watched(0));
    return peer;
  }
  /// As many viewers as an address may have.
  std::vector<LoopbackClient> full_address() {
    std::vector<LoopbackClient> many;
    for (std::size_t i = 0; i < ViewFeed::kMostPerAddress; ++i) many.push_back(upgraded());
    return many;
  }

  FakeOperatorApi operator_api_;
  FakeViews views_;
};

TEST_F(ViewSocketTest, LocalPageWatchesWithoutAProof) {
  auto peer = watching();
  make(0, "a picture");
  EXPECT_EQ(peer.next_message(), "a picture");
  ASSERT_EQ(clients().size(), 1u);
  EXPECT_EQ(clients()[0].detail, "camera views, 1 camera");
  say(peer, "");
  EXPECT_TRUE(is_unwatched(0));
}

TEST_F(ViewSocketTest, ViewsEndWithTheConnection) {
  { const auto peer = watching(); }
  EXPECT_TRUE(is_unwatched(0));
}

TEST_F(ViewSocketTest, PlainRequestGetsTheAccessRule) {
  EXPECT_THAT(get(path_), HasSubstr("\"access\":\"granted\""));
  const std::string proxied = get(path_, kProxied);
  EXPECT_THAT(proxied, HasSubstr("\"access\":\"proof\""));
  EXPECT_THAT(proxied, HasSubstr("\"cameras\":[{\"body\":1"));
  start(ViewRule::kOff);
  EXPECT_THAT(get(path_), HasSubstr("\"access\":\"denied\""));
}

TEST_F(ViewSocketTest, RefusalsStateTheReason) {
  start(ViewRule::kLoopback);
  auto peer = upgrading(kProxied);
  ASSERT_TRUE(peer.wait_for("HTTP/1.1 403"));
  EXPECT_TRUE(peer.wait_for("streaming.web.camera_views"));
  start(ViewRule::kOperator);
  operator_api_.operator_token.clear();
  auto other = upgrading(kProxied);
  EXPECT_TRUE(other.wait_for("HTTP/1.1 403"));
  EXPECT_TRUE(other.wait_for("operator.token"));
  EXPECT_TRUE(upgrading("Origin: http://elsewhere.example\r\n").wait_for("HTTP/1.1 403"));
}

TEST_F(ViewSocketTest, RemoteViewerProvesTheTokenFirst) {
  auto peer = upgraded(kProxied);
  prove(peer, operator_api_.operator_token);
  EXPECT_EQ(reply(peer).result(), v1::ControlReply::RESULT_DONE);
  say(peer, "2/0/640/10/0");
  ASSERT_TRUE(is_watched(2));
  make(2, "a picture");
  EXPECT_EQ(peer.next_message(), "a picture");
}

TEST_F(ViewSocketTest, RequestOrSilenceBeforeTheProofClosesTheConnection) {
  auto peer = upgraded(kProxied);
  say(peer, "1/0/640/10/0");
  EXPECT_TRUE(peer.wait_for(kClosed));
  auto silent = upgraded(kProxied);
  (void)reply(silent);
  clock_.advance(11s);
  EXPECT_TRUE(silent.wait_for_close());
  EXPECT_EQ(views_.asked, 0);
}

TEST_F(ViewSocketTest, InvalidRequestClosesTheConnectionWithTheReason) {
  for (const std::string bad : {"1/0/640/99/0", "give me all", "1/0/640/10/0 "}) {
    auto peer = upgraded();
    say(peer, bad);
    EXPECT_TRUE(peer.wait_for("expected BODY/CAMERA")) << bad;
    clock_.advance(1s);
  }
  auto binary = upgraded();
  binary.say("1/0/640/10/0");
  EXPECT_TRUE(binary.wait_for("expected a request as text"));
  auto loud = upgraded();
  loud.say(std::string(2000, '1'));
  EXPECT_TRUE(loud.wait_for_close());
  EXPECT_EQ(views_.asked, 0);
}

TEST_F(ViewSocketTest, ViewersOfAnAddressAreLimited) {
  const auto many = full_address();
  auto late = upgrading();
  EXPECT_TRUE(late.wait_for("HTTP/1.1 503"));
  EXPECT_TRUE(late.wait_for("too many pages show cameras"));
  (void)upgraded("", "127.0.0.2");
  auto proven = upgraded(kProxied);
  prove(proven, operator_api_.operator_token);
  EXPECT_TRUE(proven.wait_for("too many pages show cameras"));
  EXPECT_EQ(views_.asked, 0);
}

TEST_F(ViewSocketTest, ViewersWithoutProofHoldNoPlace) {
  std::vector<LoopbackClient> strangers;
  for (std::size_t i = 0; i < ViewFeed::kMostViewers + 1; ++i) {
    strangers.push_back(upgraded(kProxied, i % 2 == 0 ? "127.0.0.8" : "127.0.0.9"));
    clock_.advance(200ms);
  }
  (void)watching();
}

}  // namespace
}  // namespace fiducap::web
