// Pictures of cameras over real sockets: access, content, hostile clients.
#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <nlohmann/json.hpp>

#include "fiducap/v1/control.pb.h"
#include "loopback_client.hpp"
#include "proof/control_proof.hpp"
#include "streaming/web/view_feed.hpp"
#include "streaming/web/web.hpp"
#include "support/fake_clock.hpp"
#include "support/fake_operator_api.hpp"
#include "support/fake_views.hpp"
#include "support/scene_builder.hpp"
#include "temporary_page.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;

class ViewSocketTest : public testing::Test {
 protected:
  ViewSocketTest() { start(ViewRule::kOperator); }

  void start(ViewRule rule) {
    server_.reset();
    WebConfig config;
    config.port = 0;
    config.root = files_.root().string();
    config.hosts = {"hall"};
    config.camera_views = rule;
    WebSources sources;
    sources.operator_api = &operator_api_;
    sources.views = &views_;
    auto started =
        start_web_server(io_, config, std::move(sources), std::make_shared<SceneModel>(), clock_);
    ASSERT_TRUE(started.has_value()) << started.error().text();
    server_ = std::move(*started);
  }
  LoopbackClient client(const char* from = "127.0.0.1", int receive_buffer = 0) {
    return {io_, server_->port(), receive_buffer, from};
  }
  static void upgrade(LoopbackClient& peer, const std::string& headers = "") {
    peer.upgrade(headers, "/api/v1/views");
  }
  /// A text message; the mask is zero.
  static void say(LoopbackClient& peer, const std::string& text) {
    ASSERT_LT(text.size(), 126u);
    peer.send("\x81" + std::string(1, static_cast<char>(0x80 | text.size())) +
              std::string(4, '\0') + text);
  }
  /// Waits until the server has heard it.
  bool is_watched(std::size_t camera) {
    return run_until(io_, [&] { return views_.watched[camera].has_value(); });
  }
  bool is_left_alone(std::size_t camera) {
    return run_until(io_, [&] { return !views_.watched[camera].has_value(); });
  }
  void make(std::size_t camera, const std::string& text) {
    clock_.advance(200ms);
    views_.make(camera, text);
    server_->publish(make_scene_frame({"a"}));
  }
  std::string get(const std::string& headers = "") {
    auto peer = client();
    peer.get("/api/v1/views", headers + "Connection: close\r\n");
    EXPECT_TRUE(peer.wait_for_close());
    return peer.received();
  }
  static v1::ControlReply reply(LoopbackClient& peer) {
    v1::ControlReply out;
    const auto message = peer.next_message();
    EXPECT_TRUE(message && message->size() >= 4 && out.ParseFromString(message->substr(4)));
    return out;
  }
  static std::string proof_of(const std::string& token, const std::string& challenge) {
    v1::ControlCommand command;
    command.mutable_list_bodies();
    v1::ControlRequest made;
    made.set_sequence(1);
    made.set_body(command.SerializeAsString());
    const auto proof = proof::control_proof(token, challenge, 1, made.body());
    made.set_proof(std::string(proof.begin(), proof.end()));
    const std::string message = made.SerializeAsString();
    std::string length;
    for (int i = 0; i < 4; ++i) length += static_cast<char>(message.size() >> (8 * i));
    return length + message;
  }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  TemporaryPage files_;
  FakeOperatorApi operator_api_;
  FakeViews views_;
  std::unique_ptr<Streamer> server_;
};

// A close by policy (1008), without words.
const std::string kClosed = "\x88\x02\x03\xf0";
// A proxy on this machine forwards requests of other machines.
constexpr const char* kProxied = "X-Forwarded-For: 10.0.0.9\r\n";

TEST_F(ViewSocketTest, ThePageOfTheMachineItselfWatchesWithoutAsking) {
  auto peer = client();
  upgrade(peer);
  ASSERT_TRUE(peer.wait_for_upgrade());
  say(peer, "1/0/640/10/0");
  ASSERT_TRUE(is_watched(0));
  make(0, "a picture");
  EXPECT_EQ(peer.next_message(), "a picture");
  say(peer, "");
  EXPECT_TRUE(is_left_alone(0));
}

TEST_F(ViewSocketTest, ViewsEndWhenTheViewerLeaves) {
  {
    auto peer = client();
    upgrade(peer);
    ASSERT_TRUE(peer.wait_for_upgrade());
    say(peer, "1/0/640/10/0");
    ASSERT_TRUE(is_watched(0));
  }
  EXPECT_TRUE(is_left_alone(0));
}

TEST_F(ViewSocketTest, APlainRequestGetsTheRulesOfAccess) {
  EXPECT_NE(get().find("\"access\":\"granted\""), std::string::npos);
  const std::string answer = get(kProxied);
  EXPECT_NE(answer.find("\"access\":\"proof\""), std::string::npos) << answer;
  EXPECT_NE(answer.find("\"cameras\":[{\"body\":1"), std::string::npos);
  start(ViewRule::kOff);
  EXPECT_NE(get().find("\"access\":\"denied\""), std::string::npos);
}

TEST_F(ViewSocketTest, RefusalsHaveTheReason) {
  start(ViewRule::kLoopback);
  auto peer = client();
  upgrade(peer, kProxied);
  ASSERT_TRUE(peer.wait_for("HTTP/1.1 403"));
  EXPECT_TRUE(peer.wait_for("streaming.web.camera_views"));
  start(ViewRule::kOperator);
  operator_api_.operator_token.clear();
  auto other = client();
  upgrade(other, kProxied);
  EXPECT_TRUE(other.wait_for("HTTP/1.1 403"));
  EXPECT_TRUE(other.wait_for("operator.token"));
}

TEST_F(ViewSocketTest, APageFromElsewhereDoesNotGetIn) {
  auto peer = client();
  upgrade(peer, "Origin: http://elsewhere.example\r\n");
  EXPECT_TRUE(peer.wait_for("HTTP/1.1 403"));
}

TEST_F(ViewSocketTest, WhoKnowsTheTokenProvesItFirst) {
  auto peer = client();
  upgrade(peer, kProxied);
  ASSERT_TRUE(peer.wait_for_upgrade());
  peer.say(proof_of(operator_api_.operator_token, reply(peer).hello().challenge()));
  EXPECT_EQ(reply(peer).result(), v1::ControlReply::RESULT_DONE);
  say(peer, "2/0/640/10/0");
  ASSERT_TRUE(is_watched(2));
  make(2, "a picture");
  EXPECT_EQ(peer.next_message(), "a picture");
}

TEST_F(ViewSocketTest, AWrongTokenShowsNothingAndFiveKeepTheAddressOut) {
  for (int i = 0; i < net::WrongProofs::kAllowed; ++i) {
    auto peer = client();
    upgrade(peer, kProxied);
    ASSERT_TRUE(peer.wait_for_upgrade());
    peer.say(proof_of("a guess", reply(peer).hello().challenge()));
    EXPECT_EQ(reply(peer).result(), v1::ControlReply::RESULT_FORBIDDEN);
    EXPECT_TRUE(peer.wait_for(kClosed));
  }
  auto peer = client();
  upgrade(peer, kProxied);
  ASSERT_TRUE(peer.wait_for_upgrade());
  peer.say(proof_of(operator_api_.operator_token, reply(peer).hello().challenge()));
  EXPECT_EQ(reply(peer).result(), v1::ControlReply::RESULT_BUSY);
  EXPECT_EQ(views_.asked, 0);
}

TEST_F(ViewSocketTest, AWishBeforeTheProofEndsTheConversation) {
  auto peer = client();
  upgrade(peer, kProxied);
  ASSERT_TRUE(peer.wait_for_upgrade());
  say(peer, "1/0/640/10/0");
  EXPECT_TRUE(peer.wait_for(kClosed));
  EXPECT_EQ(views_.asked, 0);
}

TEST_F(ViewSocketTest, WhoSaysNothingBeforeTheProofIsClosed) {
  auto peer = client();
  upgrade(peer, kProxied);
  ASSERT_TRUE(peer.wait_for_upgrade());
  (void)reply(peer);
  clock_.advance(11s);
  EXPECT_TRUE(peer.wait_for_close());
}

TEST_F(ViewSocketTest, AnInvalidRequestClosesTheConnectionWithTheReason) {
  for (const std::string bad : {"1/0/640/99/0", "give me all", "1/0/640/10/0 "}) {
    auto peer = client();
    upgrade(peer);
    ASSERT_TRUE(peer.wait_for_upgrade());
    say(peer, bad);
    EXPECT_TRUE(peer.wait_for("expected BODY/CAMERA")) << bad;
    clock_.advance(1s);
  }
  auto binary = client();
  upgrade(binary);
  ASSERT_TRUE(binary.wait_for_upgrade());
  binary.say("1/0/640/10/0");
  EXPECT_TRUE(binary.wait_for("expected a request as text"));
  auto loud = client();
  upgrade(loud);
  ASSERT_TRUE(loud.wait_for_upgrade());
  loud.say(std::string(2000, '1'));
  EXPECT_TRUE(loud.wait_for_close());
  EXPECT_EQ(views_.asked, 0);
}

TEST_F(ViewSocketTest, TooManyViewersGetTheReason) {
  std::vector<LoopbackClient> many;
  for (std::size_t i = 0; i < ViewFeed::kMostPerAddress; ++i) {
    many.push_back(client());
    upgrade(many.back());
    ASSERT_TRUE(many.back().wait_for_upgrade());
  }
  auto late = client();
  upgrade(late);
  EXPECT_TRUE(late.wait_for("HTTP/1.1 503"));
  EXPECT_TRUE(late.wait_for("too many pages show cameras"));
  auto other = client("127.0.0.2");
  upgrade(other);
  EXPECT_TRUE(other.wait_for_upgrade()) << "another address has its own places";
}

TEST_F(ViewSocketTest, WhoHasProvenNothingHoldsNoPlace) {
  std::vector<LoopbackClient> strangers;
  for (std::size_t i = 0; i < ViewFeed::kMostViewers + 1; ++i) {
    strangers.push_back(client(i % 2 == 0 ? "127.0.0.8" : "127.0.0.9"));
    upgrade(strangers.back(), kProxied);
    ASSERT_TRUE(strangers.back().wait_for_upgrade());
    clock_.advance(200ms);
  }
  auto here = client();
  upgrade(here);
  EXPECT_TRUE(here.wait_for_upgrade()) << here.received();
  say(here, "1/0/640/10/0");
  EXPECT_TRUE(is_watched(0));
}

TEST_F(ViewSocketTest, AProofDoesNotHelpWhereAllPlacesAreTaken) {
  std::vector<LoopbackClient> many;
  for (std::size_t i = 0; i < ViewFeed::kMostPerAddress; ++i) {
    many.push_back(client());
    upgrade(many.back());
    ASSERT_TRUE(many.back().wait_for_upgrade());
  }
  auto late = client();
  upgrade(late, kProxied);
  ASSERT_TRUE(late.wait_for_upgrade());
  late.say(proof_of(operator_api_.operator_token, reply(late).hello().challenge()));
  EXPECT_TRUE(late.wait_for("too many pages show cameras"));
  EXPECT_EQ(views_.asked, 0);
}

TEST_F(ViewSocketTest, ClosesAStoppedReaderAndDelaysNoOther) {
  auto slow = client("127.0.0.1", 4096);
  upgrade(slow);
  ASSERT_TRUE(slow.wait_for_upgrade());
  say(slow, "1/0/640/10/0");
  ASSERT_TRUE(is_watched(0));
  auto quick = client("127.0.0.2");
  upgrade(quick);
  ASSERT_TRUE(quick.wait_for_upgrade());
  say(quick, "1/1/640/10/0");
  ASSERT_TRUE(is_watched(1));
  const std::string large(1 << 20, 'x');
  for (int i = 0; i < 5; ++i) {
    make(0, large);
    make(1, "for the other");
    EXPECT_EQ(quick.next_message(), "for the other");
  }
  clock_.advance(6s);
  EXPECT_TRUE(is_left_alone(0)) << "it was closed";
  EXPECT_TRUE(views_.watched[1].has_value());
}

TEST_F(ViewSocketTest, ViewersAreListedAmongTheClients) {
  auto peer = client();
  upgrade(peer);
  ASSERT_TRUE(peer.wait_for_upgrade());
  say(peer, "1/0/640/10/0");
  ASSERT_TRUE(is_watched(0));
  std::vector<ClientStatus> all;
  server_->append_clients(all);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].detail, "camera views, 1 camera");
}

}  // namespace
}  // namespace fiducap::web
