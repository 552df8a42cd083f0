// The control channel behind a WebSocket, by real sockets.
#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>

#include "fiducap/v1/control.pb.h"
#include "loopback_client.hpp"
#include "proof/control_proof.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/web/web.hpp"
#include "support/fake_clock.hpp"
#include "support/fake_operator_api.hpp"
#include "temporary_page.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;

class ControlSocketTest : public testing::Test {
 protected:
  ControlSocketTest() { start(&operator_api_); }

  void start(OperatorApi* operator_api) {
    server_.reset();
    WebConfig config;
    config.port = 0;
    config.root = files_.root().string();
    config.hosts = {"hall"};
    WebSources sources;
    sources.operator_api = operator_api;
    auto started =
        start_web_server(io_, config, std::move(sources), std::make_shared<SceneModel>(), clock_);
    ASSERT_TRUE(started.has_value()) << started.error().text();
    server_ = std::move(*started);
  }
  LoopbackClient client(const char* from = "127.0.0.1") { return {io_, server_->port(), 0, from}; }
  static void upgrade(LoopbackClient& peer, const std::string& headers = "") {
    peer.upgrade(headers, "/api/v1/control");
  }
  static v1::ControlReply reply(LoopbackClient& peer) {
    v1::ControlReply out;
    const auto message = peer.next_message();
    EXPECT_TRUE(message && message->size() >= 4 && out.ParseFromString(message->substr(4)));
    return out;
  }
  static std::string request(const std::string& challenge, const std::string& token,
                             std::uint64_t sequence = 1) {
    v1::ControlCommand command;
    command.mutable_forget_tag()->set_tag_id(7);
    v1::ControlRequest made;
    made.set_sequence(sequence);
    made.set_body(command.SerializeAsString());
    const auto proof = proof::control_proof(token, challenge, sequence, made.body());
    made.set_proof(std::string(proof.begin(), proof.end()));
    const std::string message = made.SerializeAsString();
    std::string length;
    for (int i = 0; i < 4; ++i) length += static_cast<char>(message.size() >> (8 * i));
    return length + message;
  }
  /// @return the reply to a command with this token
  v1::ControlReply command(const std::string& token) {
    auto peer = client();
    upgrade(peer);
    EXPECT_TRUE(peer.wait_for_upgrade());
    const std::string challenge = reply(peer).hello().challenge();
    EXPECT_EQ(challenge.size(), 32u);
    peer.say(request(challenge, token));
    return reply(peer);
  }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  TemporaryPage files_;
  FakeOperatorApi operator_api_;
  std::unique_ptr<Streamer> server_;
};

TEST_F(ControlSocketTest, CarriesOutWhatIsProven) {
  EXPECT_EQ(command(operator_api_.operator_token).result(), v1::ControlReply::RESULT_DONE);
  ASSERT_EQ(operator_api_.changes.size(), 1u);
  EXPECT_EQ(std::get<ForgetTag>(operator_api_.changes[0]).tag_id, 7);
}

TEST_F(ControlSocketTest, RepliesWithTheReasonOfARefusal) {
  operator_api_.refusal = "the map is frozen";
  const auto said = command(operator_api_.operator_token);
  EXPECT_EQ(said.result(), v1::ControlReply::RESULT_REFUSED);
  EXPECT_EQ(said.text(), "the map is frozen");
}

TEST_F(ControlSocketTest, AWrongTokenChangesNothingAndFiveKeepTheAddressOut) {
  for (int i = 0; i < net::WrongProofs::kAllowed; ++i)
    EXPECT_EQ(command("a guess").result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_EQ(command(operator_api_.operator_token).result(), v1::ControlReply::RESULT_BUSY);
  EXPECT_TRUE(operator_api_.changes.empty());
}

TEST_F(ControlSocketTest, AServerWithoutATokenTakesNoCommand) {
  operator_api_.operator_token.clear();
  EXPECT_EQ(command("").result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_TRUE(operator_api_.changes.empty());
}

TEST_F(ControlSocketTest, WhatWasProvenElsewhereIsWorthNothing) {
  auto peer = client();
  upgrade(peer);
  ASSERT_TRUE(peer.wait_for_upgrade());
  (void)reply(peer);
  peer.say(request(std::string(32, 'c'), operator_api_.operator_token));
  EXPECT_EQ(reply(peer).result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_TRUE(operator_api_.changes.empty());
}

TEST_F(ControlSocketTest, APageFromElsewhereDoesNotEvenGetIn) {
  for (int i = 0; i < 2 * net::WrongProofs::kAllowed; ++i) {
    auto peer = client();
    upgrade(peer, "Origin: http://elsewhere.example\r\n");
    EXPECT_TRUE(peer.wait_for("HTTP/1.1 403"));
  }
  EXPECT_EQ(command(operator_api_.operator_token).result(), v1::ControlReply::RESULT_DONE)
      << "nor can it use up its visitor's guesses";
}

TEST_F(ControlSocketTest, IsNotThereWithoutADesk) {
  start(nullptr);
  auto peer = client();
  upgrade(peer);
  EXPECT_TRUE(peer.wait_for("HTTP/1.1 404"));
}

TEST_F(ControlSocketTest, EndsWithWhoSaysTooMuchOrNothing) {
  auto loud = client();
  upgrade(loud);
  ASSERT_TRUE(loud.wait_for_upgrade());
  loud.say(std::string(8193, 'x'));
  EXPECT_TRUE(loud.wait_for_close());
  auto silent = client();
  upgrade(silent);
  ASSERT_TRUE(silent.wait_for_upgrade());
  (void)reply(silent);
  clock_.advance(11s);
  EXPECT_TRUE(silent.wait_for_close());
}

TEST_F(ControlSocketTest, OneAddressDoesNotKeepOthersOut) {
  std::vector<LoopbackClient> many;
  for (int i = 0; i < 16; ++i) {
    many.push_back(client("127.0.0.2"));
    upgrade(many.back());
    ASSERT_TRUE(many.back().wait_for_upgrade());
  }
  EXPECT_EQ(command(operator_api_.operator_token).result(), v1::ControlReply::RESULT_DONE);
}

TEST_F(ControlSocketTest, ARequestMayComeInPieces) {
  auto peer = client();
  upgrade(peer);
  ASSERT_TRUE(peer.wait_for_upgrade());
  const std::string whole = request(reply(peer).hello().challenge(), operator_api_.operator_token);
  peer.say(whole.substr(0, 3));
  peer.say(whole.substr(3));
  EXPECT_EQ(reply(peer).result(), v1::ControlReply::RESULT_DONE);
}

}  // namespace
}  // namespace fiducap::web
