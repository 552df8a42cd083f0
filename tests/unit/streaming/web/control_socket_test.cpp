// The control channel behind a WebSocket, over real sockets.
#include "streaming/net/limits.hpp"
#include "support/control_request.hpp"
#include "support/fake_operator_api.hpp"
#include "web_server_fixture.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using v1::ControlReply;

class ControlSocketTest : public WebServerFixture {
 protected:
  ControlSocketTest() {
    path_ = "/api/v1/control";
    context_.operator_api = &operator_api_;
    start();
  }
  static ControlReply reply(LoopbackClient& peer) {
    return control_reply(peer.next_message().value_or(""));
  }
  static std::string request(const std::string& challenge, const std::string& token) {
    v1::ControlCommand command;
    command.mutable_forget_tag()->set_tag_id(7);
    return control_request(token, challenge, command.SerializeAsString());
  }
  /// @return the reply to a command with this token
  ControlReply command(const std::string& token) {
    auto peer = upgraded();
    const std::string challenge = reply(peer).hello().challenge();
    EXPECT_EQ(challenge.size(), 32u);
    peer.say(request(challenge, token));
    return reply(peer);
  }
  ControlReply command() { return command(operator_api_.operator_token); }

  FakeOperatorApi operator_api_;
};

TEST_F(ControlSocketTest, ExecutesProvenCommands) {
  EXPECT_EQ(command().result(), ControlReply::RESULT_DONE);
  ASSERT_EQ(operator_api_.changes.size(), 1u);
  EXPECT_EQ(std::get<ForgetTag>(operator_api_.changes[0]).tag_id, 7);
}

TEST_F(ControlSocketTest, RefusesAnAddressAfterFiveWrongTokens) {
  for (int i = 0; i < net::WrongProofs::kAllowed; ++i)
    EXPECT_EQ(command("a guess").result(), ControlReply::RESULT_FORBIDDEN);
  EXPECT_EQ(command().result(), ControlReply::RESULT_BUSY);
  EXPECT_TRUE(operator_api_.changes.empty());
}

TEST_F(ControlSocketTest, RefusesPagesOfOtherOrigins) {
  for (int i = 0; i < 2 * net::WrongProofs::kAllowed; ++i) {
    auto peer = upgrading("Origin: http://elsewhere.example\r\n");
    EXPECT_TRUE(peer.wait_for("HTTP/1.1 403"));
  }
  EXPECT_EQ(command().result(), ControlReply::RESULT_DONE) << "these were no guesses";
}

TEST_F(ControlSocketTest, IsAbsentWithoutAnOperatorApi) {
  context_.operator_api = nullptr;
  start();
  EXPECT_TRUE(upgrading().wait_for("HTTP/1.1 404"));
}

TEST_F(ControlSocketTest, ClosesForTooLongMessagesAndForSilence) {
  auto loud = upgraded();
  loud.say(std::string(8193, 'x'));
  EXPECT_TRUE(loud.wait_for_close());
  auto silent = upgraded();
  (void)reply(silent);
  clock_.advance(11s);
  EXPECT_TRUE(silent.wait_for_close());
}

TEST_F(ControlSocketTest, OneAddressDoesNotExcludeOthers) {
  std::vector<LoopbackClient> many;
  for (int i = 0; i < 16; ++i) many.push_back(upgraded("", "127.0.0.2"));
  EXPECT_EQ(command().result(), ControlReply::RESULT_DONE);
}

}  // namespace
}  // namespace fiducap::web
