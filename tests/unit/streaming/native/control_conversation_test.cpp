#include "streaming/native/control_session.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "support/control_request.hpp"
#include "support/fake_operator_api.hpp"
#include "support/hex.hpp"

namespace fiducap::native {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::byte>;

const std::string kChallenge(32, 'c');

std::string commit() {
  v1::ControlCommand command;
  command.mutable_commit_map();
  return command.SerializeAsString();
}
Bytes bytes(const std::string& text) {
  const auto view = std::as_bytes(std::span(text));
  return {view.begin(), view.end()};
}
Bytes request(std::uint64_t sequence, const std::string& body = commit(),
              const std::string& challenge = kChallenge,
              const std::string& token = "correct horse") {
  return bytes(control_request(token, challenge, body, sequence));
}
Bytes joined(Bytes first, const Bytes& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

class ControlConversationTest : public testing::Test {
 protected:
  ControlConversationTest() { conversation_.greet(out_, now_); }

  bool receive(const Bytes& bytes) {
    out_.clear();
    return conversation_.receive(bytes, out_, now_);
  }
  /// On a new connection from this address.
  bool receive_from(std::uint64_t address, const Bytes& bytes) {
    ControlConversation conversation(kChallenge, operator_api_, wrong_, {address});
    out_.clear();
    return conversation.receive(bytes, out_, now_);
  }
  v1::ControlReply reply() const {
    return control_reply({reinterpret_cast<const char*>(out_.data()), out_.size()});
  }
  [[nodiscard]] std::size_t changes() const { return operator_api_.changes.size(); }

  Instant now_ = instant_from_ns(50'000'000'000);
  FakeOperatorApi operator_api_;
  WrongProofs wrong_;
  Bytes out_;
  ControlConversation conversation_{
      kChallenge, operator_api_, wrong_, {7, {"native", kOperatorRight, "10.0.0.7:5"}}};
};

TEST_F(ControlConversationTest, ExecutesProvenCommandsOnce) {
  EXPECT_EQ(reply().hello().challenge(), kChallenge);
  const auto recorded = request(1);
  EXPECT_TRUE(receive(recorded));
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_DONE);
  EXPECT_EQ(reply().sequence(), 1u);
  EXPECT_EQ(changes(), 1U);
  EXPECT_FALSE(receive(recorded)) << "a recorded request has no effect";
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_EQ(changes(), 1U);
}

TEST_F(ControlConversationTest, AcceptsAnyFragmentation) {
  for (const std::byte one : joined(request(1), request(2))) EXPECT_TRUE(receive({one}));
  EXPECT_EQ(changes(), 2U);
  EXPECT_TRUE(receive(joined(request(3), request(4))));
  EXPECT_EQ(changes(), 4U);
}

TEST_F(ControlConversationTest, RefusesUnprovenAndMalformedRequests) {
  EXPECT_FALSE(receive_from(7, request(1, commit(), std::string(32, 'd')))) << "another connection";
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_FORBIDDEN);
  auto changed = request(1);
  changed.back() ^= std::byte{1};
  EXPECT_FALSE(receive_from(7, changed));
  EXPECT_FALSE(receive_from(7, Bytes(4, std::byte{0xff}))) << "an announced size of 4 GiB";
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_MALFORMED);
  operator_api_.operator_token.clear();
  EXPECT_FALSE(receive_from(8, request(1, commit(), kChallenge, ""))) << "without a token";
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_EQ(changes(), 0U);
}

TEST_F(ControlConversationTest, RefusesTruncatedMessages) {
  const auto whole = request(1);
  for (std::size_t size = 4; size < whole.size(); ++size) {
    Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    cut[0] = static_cast<std::byte>(size - 4);
    EXPECT_FALSE(receive_from(size, cut)) << size;
  }
  EXPECT_EQ(changes(), 0U);
}

TEST_F(ControlConversationTest, RefusesAnAddressAfterFiveWrongTokens) {
  for (int i = 0; i < WrongProofs::kAllowed; ++i)
    EXPECT_FALSE(receive_from(7, request(1, commit(), kChallenge, "guess")));
  EXPECT_FALSE(receive(request(1)));
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_BUSY);
  EXPECT_TRUE(receive_from(8, request(1))) << "another address";
  now_ += WrongProofs::kWindow;
  EXPECT_TRUE(receive_from(7, request(1)));
}

TEST_F(ControlConversationTest, ReportsRefusalsAndCommandsOfALaterVersion) {
  operator_api_.refusal = "the map is frozen";
  EXPECT_TRUE(receive(request(1)));
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_REFUSED);
  EXPECT_EQ(reply().text(), "the map is frozen");
  EXPECT_TRUE(receive(request(2, std::string("\xfa\x07\x00", 3))));  // field 127
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_UNSUPPORTED);
}

TEST_F(ControlConversationTest, EndsForSilentAndSlowClients) {
  EXPECT_TRUE(conversation_.is_alive(now_ + 9s));
  EXPECT_FALSE(conversation_.is_alive(now_ + 10s));
  ASSERT_TRUE(receive(request(1)));
  EXPECT_TRUE(conversation_.is_alive(now_ + 60s));
  for (const std::byte one :
       {std::byte{50}, std::byte{0}, std::byte{0}, std::byte{0}, std::byte{1}}) {
    EXPECT_TRUE(receive({one}));  // a byte every three seconds
    now_ += 3s;
  }
  EXPECT_FALSE(conversation_.is_alive(now_));
}

TEST(ControlProof, Sha256AndHmacMatchTheStandards) {
  const auto digest = [](auto&& hash, const std::string& text) {
    hash.add(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    const proof::Digest made = hash.digest();
    const auto view = std::as_bytes(std::span(made));
    return to_hex({view.begin(), view.end()});
  };
  const auto sha = [&](const std::string& text) { return digest(proof::Sha256(), text); };
  const auto hmac = [&](const std::string& key, const std::string& text) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(key.data());
    return digest(proof::Hmac(bytes, key.size()), text);
  };
  // FIPS 180-4 examples; RFC 4231 test cases 2 and 6 (a key longer than a block).
  EXPECT_EQ(sha("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  EXPECT_EQ(hmac("Jefe", "what do ya want for nothing?"),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
  EXPECT_EQ(
      hmac(std::string(131, '\xaa'), "Test Using Larger Than Block-Size Key - Hash Key First"),
      "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54");
}

TEST_F(ControlConversationTest, EventsAreEncodedOnceForAllWatchers) {
  EventBoard board{[] { return std::int64_t{0}; }};
  SharedEvents shared(board);
  v1::ControlRequest watch;
  watch.mutable_watch_events();
  std::vector<std::unique_ptr<ControlConversation>> watchers;
  for (int i = 0; i < 32; ++i) {
    watchers.push_back(std::make_unique<ControlConversation>(kChallenge, operator_api_, wrong_,
                                                             ControlClient{7, {}, false, &shared}));
    watch.set_sequence(static_cast<std::uint64_t>(i) + 1);
    ASSERT_TRUE(
        watchers.back()->receive(bytes(control_frame(watch.SerializeAsString())), out_, now_));
  }
  EXPECT_EQ(shared.encodings(), 1U);
  for (int i = 0; i < 10; ++i) {
    board.begin({.severity = Severity::kWarning,
                 .subject = "drone",
                 .kind = "overload",
                 .text = std::to_string(i) + " % are left out"});
    for (std::uint64_t w = 0; w < watchers.size(); ++w) {
      out_.clear();
      watchers[w]->append_events(out_, now_);
      ASSERT_EQ(reply().sequence(), w + 1);
      ASSERT_EQ(reply().events().standing_size(), 1);
      ASSERT_EQ(reply().events().standing(0).text(), std::to_string(i) + " % are left out");
      ASSERT_EQ(reply().events().happened_size(), i == 0 ? 1 : 0);
    }
  }
  EXPECT_EQ(shared.encodings(), 11U);
}

}  // namespace
}  // namespace fiducap::native
