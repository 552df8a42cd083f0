#include "streaming/native/control_session.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "fiducap/v1/control.pb.h"
#include "proof/control_proof.hpp"
#include "support/fake_operator_api.hpp"

namespace fiducap::native {
namespace {

class ControlConversationTest : public testing::Test {
 protected:
  ControlConversationTest() { conversation_.greet(out_, now_); }

  static std::string commit() {
    v1::ControlCommand command;
    command.mutable_commit_map();
    return command.SerializeAsString();
  }
  static std::vector<std::byte> framed(const std::string& message) {
    std::vector<std::byte> bytes;
    for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::byte>(message.size() >> (8 * i)));
    for (const char c : message) bytes.push_back(static_cast<std::byte>(c));
    return bytes;
  }
  static std::vector<std::byte> request(std::uint64_t sequence, const std::string& body,
                                        const std::string& challenge = std::string(32, 'c'),
                                        const std::string& token = "correct horse") {
    v1::ControlRequest made;
    made.set_sequence(sequence);
    const auto proof = proof::control_proof(token, challenge, sequence, body);
    made.set_proof(std::string(proof.begin(), proof.end()));
    made.set_body(body);
    return framed(made.SerializeAsString());
  }
  bool say(const std::vector<std::byte>& bytes) {
    out_.clear();
    return conversation_.receive(bytes, out_, now_);
  }
  v1::ControlReply reply() const {
    v1::ControlReply message;
    EXPECT_TRUE(out_.size() > 4 &&
                message.ParseFromArray(out_.data() + 4, static_cast<int>(out_.size()) - 4));
    return message;
  }

  Instant now_ = instant_from_ns(50'000'000'000);
  FakeOperatorApi operator_api_;
  WrongProofs wrong_;
  std::vector<std::byte> out_;
  ControlConversation conversation_{std::string(32, 'c'), operator_api_, wrong_, 7};
};

TEST_F(ControlConversationTest, GreetsWithItsChallenge) {
  EXPECT_EQ(reply().hello().challenge(), std::string(32, 'c'));
}

TEST_F(ControlConversationTest, CarriesOutWhatIsProven) {
  EXPECT_TRUE(say(request(1, commit())));
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_DONE);
  EXPECT_EQ(reply().sequence(), 1u);
  EXPECT_EQ(operator_api_.changes.size(), 1U);
}

TEST_F(ControlConversationTest, ReadsBytesCutAnywhereAndSeveralAtOnce) {
  auto bytes = request(1, commit());
  const auto second = request(2, commit());
  bytes.insert(bytes.end(), second.begin(), second.end());
  for (const std::byte one : bytes) EXPECT_TRUE(say({one}));
  EXPECT_EQ(operator_api_.changes.size(), 2U);
  auto third = request(3, commit());
  const auto fourth = request(4, commit());
  third.insert(third.end(), fourth.begin(), fourth.end());
  EXPECT_TRUE(say(third));
  EXPECT_EQ(operator_api_.changes.size(), 4U);
}

TEST_F(ControlConversationTest, ARecordedRequestIsWorthNothingTwice) {
  const auto recorded = request(1, commit());
  ASSERT_TRUE(say(recorded));
  EXPECT_FALSE(say(recorded));
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_EQ(operator_api_.changes.size(), 1U);
}

TEST_F(ControlConversationTest, ARecordedRequestIsWorthNothingOnAnotherConnection) {
  EXPECT_FALSE(say(request(1, commit(), std::string(32, 'd'))));
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_FORBIDDEN);
  EXPECT_EQ(operator_api_.changes.size(), 0U);
}

TEST_F(ControlConversationTest, AChangedCommandIsNotProven) {
  auto bytes = request(1, commit());
  bytes.back() ^= std::byte{1};
  EXPECT_FALSE(say(bytes));
  EXPECT_EQ(operator_api_.changes.size(), 0U);
}

TEST_F(ControlConversationTest, NoTruncationOfAMessageDoesAnything) {
  const auto whole = request(1, commit());
  for (std::size_t size = 4; size < whole.size(); ++size) {
    auto cut =
        std::vector<std::byte>(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    cut[0] = static_cast<std::byte>(size - 4);
    ControlConversation conversation(std::string(32, 'c'), operator_api_, wrong_, size);
    std::vector<std::byte> out;
    EXPECT_FALSE(conversation.receive(cut, out, now_)) << size;
  }
  EXPECT_EQ(operator_api_.changes.size(), 0U);
}

TEST_F(ControlConversationTest, KeepsNothingOfAMessageThatClaimsFourGibibytes) {
  EXPECT_FALSE(say({std::byte{0xff}, std::byte{0xff}, std::byte{0xff}, std::byte{0xff}}));
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_MALFORMED);
}

TEST_F(ControlConversationTest, RefusesTheRightTokenTooAfterFiveWrongOnes) {
  for (int i = 0; i < WrongProofs::kAllowed; ++i) {
    ControlConversation guess(std::string(32, 'c'), operator_api_, wrong_, 7);
    std::vector<std::byte> out;
    EXPECT_FALSE(guess.receive(request(1, commit(), std::string(32, 'c'), "guess"), out, now_));
  }
  EXPECT_FALSE(say(request(1, commit())));
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_BUSY);
  ControlConversation elsewhere(std::string(32, 'c'), operator_api_, wrong_, 8);
  EXPECT_TRUE(elsewhere.receive(request(1, commit()), out_, now_)) << "another address";
  now_ += WrongProofs::kWindow;
  ControlConversation later(std::string(32, 'c'), operator_api_, wrong_, 7);
  EXPECT_TRUE(later.receive(request(1, commit()), out_, now_));
}

TEST_F(ControlConversationTest, SaysThatACommandIsOfALaterVersion) {
  EXPECT_TRUE(say(request(1, std::string("\xfa\x07\x00", 3))));  // field 127
  EXPECT_EQ(reply().result(), v1::ControlReply::RESULT_UNSUPPORTED);
}

TEST_F(ControlConversationTest, ClosesSilentAndSlowClients) {
  EXPECT_TRUE(conversation_.is_alive(now_ + std::chrono::seconds(9)));
  EXPECT_FALSE(conversation_.is_alive(now_ + std::chrono::seconds(10)));
  ASSERT_TRUE(say(request(1, commit())));
  EXPECT_TRUE(conversation_.is_alive(now_ + std::chrono::seconds(60)));
  for (const std::byte one :
       {std::byte{50}, std::byte{0}, std::byte{0}, std::byte{0}, std::byte{1}}) {
    EXPECT_TRUE(say({one}));  // a byte every three seconds
    now_ += std::chrono::seconds(3);
  }
  EXPECT_FALSE(conversation_.is_alive(now_));
}

TEST_F(ControlConversationTest, RandomBytesDoNothing) {
  std::mt19937 random(3);  // NOLINT: the same bytes in every run
  for (int i = 0; i < 3000; ++i) {
    ControlConversation conversation(std::string(32, 'c'), operator_api_, wrong_, random());
    auto bytes = request(1, commit());
    for (unsigned changes = 1 + random() % 4; changes > 0; --changes) {
      bytes[4 + random() % (bytes.size() - 4)] ^= static_cast<std::byte>(1 + random() % 255);
    }
    std::vector<std::byte> out;
    (void)conversation.receive(bytes, out, now_);
  }
  EXPECT_EQ(operator_api_.changes.size(), 0U);
}

TEST(ControlProof, Sha256AndHmacMatchTheStandards) {
  const auto hex = [](const proof::Digest& digest) {
    std::string text;
    for (const auto byte : digest)
      text += "0123456789abcdef"[byte >> 4], text += "0123456789abcdef"[byte & 15];
    return text;
  };
  const auto sha = [&](const std::string& text) {
    proof::Sha256 hash;
    hash.add(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    return hex(hash.digest());
  };
  // FIPS 180-4 examples; RFC 4231 test cases 2 and 6 (a key longer than a block).
  EXPECT_EQ(sha("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  const auto hmac = [&](const std::string& key, const std::string& text) {
    proof::Hmac made(reinterpret_cast<const std::uint8_t*>(key.data()), key.size());
    made.add(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    return hex(made.digest());
  };
  EXPECT_EQ(hmac("Jefe", "what do ya want for nothing?"),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
  EXPECT_EQ(
      hmac(std::string(131, '\xaa'), "Test Using Larger Than Block-Size Key - Hash Key First"),
      "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54");
}

TEST_F(ControlConversationTest, WhatManyWatchIsEncodedOnce) {
  EventBoard board{[] { return std::int64_t{0}; }};
  SharedEvents shared(board);
  v1::ControlRequest request;
  request.set_sequence(1);
  request.mutable_watch_events();
  std::vector<std::unique_ptr<ControlConversation>> watchers;
  for (int i = 0; i < 32; ++i) {
    watchers.push_back(std::make_unique<ControlConversation>(std::string(32, 'c'), operator_api_,
                                                             wrong_, 7, &shared));
    request.set_sequence(static_cast<std::uint64_t>(i) + 1);
    ASSERT_TRUE(watchers.back()->receive(framed(request.SerializeAsString()), out_, now_));
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
