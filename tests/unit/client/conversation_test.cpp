#include "src/conversation.hpp"

#include <gtest/gtest.h>

namespace fiducap::sdk {
namespace {

constexpr Nanoseconds kRetry = 500 * kMillisecond;
constexpr std::uint64_t kNonce = 42;
constexpr std::uint64_t kSession = 7;
constexpr std::uint64_t kModel = 1;

class ConversationTest : public testing::Test {
 protected:
  ConversationTest() { conversation_.start(now_); }

  /// @return the question that is due, or nothing
  bool asks(std::uint64_t model = kModel) {
    conversation_.tick(now_);
    if (!conversation_.due(now_)) return false;
    question_ = conversation_.question(model, now_);
    return true;
  }
  void challenge(std::uint64_t token, std::uint64_t session = kSession) {
    conversation_.on(Challenge{token, kNonce, session}, now_);
  }
  void lease(std::uint64_t token, std::uint64_t session = kSession) {
    EXPECT_TRUE(conversation_.on(Lease{session, kNonce, token, 3 * kSecond, kModel}, now_));
  }
  void connect() {
    ASSERT_TRUE(asks(0));
    challenge(1);
    ASSERT_TRUE(asks(0));
    lease(2);
    now_ += 100 * kMillisecond;
    conversation_.heard(kSession, now_);
    ASSERT_TRUE(asks()) << "asks once more to tell that the model is here";
    lease(2);
  }

  Nanoseconds now_ = 1000 * kSecond;
  Conversation conversation_{kRetry, kNonce, "test"};
  SubscribeRequest question_;
};

TEST_F(ConversationTest, AsksAtOnceAndThenOncePerPause) {
  EXPECT_TRUE(asks());
  EXPECT_EQ(question_.token, 0u);
  EXPECT_EQ(question_.nonce, kNonce);
  EXPECT_EQ(question_.client_name, "test");
  EXPECT_FALSE(asks());
  now_ += kRetry - 1;
  EXPECT_FALSE(asks());
  now_ += 1;
  EXPECT_TRUE(asks());
  EXPECT_EQ(conversation_.unanswered(), 2);
}

TEST_F(ConversationTest, ReturnsTheTokenAtOnce) {
  ASSERT_TRUE(asks());
  challenge(99);
  ASSERT_TRUE(asks());
  EXPECT_EQ(question_.token, 99u);
  lease(100);
  EXPECT_TRUE(conversation_.leased());
  EXPECT_EQ(conversation_.session(), kSession);
  EXPECT_EQ(conversation_.problem(), "");
}

TEST_F(ConversationTest, IgnoresAnswersToSomebodyElse) {
  ASSERT_TRUE(asks());
  conversation_.on(Challenge{99, kNonce + 1, kSession}, now_);
  EXPECT_FALSE(asks());
  EXPECT_FALSE(conversation_.on(Lease{kSession, kNonce + 1, 1, kSecond, kModel}, now_));
  conversation_.on(Notice{kSession, kNonce + 1, true, "no"}, now_);
  EXPECT_FALSE(conversation_.leased());
}

TEST_F(ConversationTest, DoesNotSpinWhenEveryAnswerIsAChallenge) {
  int questions = 0;
  const Nanoseconds end = now_ + kSecond;
  while (now_ < end) {
    if (asks()) {
      ++questions;
      challenge(1);
    }
    now_ += kMillisecond;
  }
  EXPECT_LE(questions, 25);
}

TEST_F(ConversationTest, AsksQuicklyForAModelThatDidNotArrive) {
  ASSERT_TRUE(asks(0));
  challenge(1);
  ASSERT_TRUE(asks(0));
  lease(2);
  now_ += 100 * kMillisecond;
  ASSERT_TRUE(asks(0));
  EXPECT_EQ(question_.token, 2u);
  EXPECT_EQ(question_.model_generation, 0u);
}

TEST_F(ConversationTest, RenewsThreeTimesPerLeaseWhileFramesFlow) {
  connect();
  int questions = 0;
  for (int i = 0; i < 300; ++i) {
    now_ += 10 * kMillisecond;
    EXPECT_TRUE(conversation_.heard(kSession, now_));
    if (asks()) {
      ++questions;
      lease(2);
    }
    ASSERT_TRUE(conversation_.leased());
  }
  EXPECT_EQ(questions, 3);
}

TEST_F(ConversationTest, ProbesASilentServerAndKeepsTheLeaseWhenItAnswers) {
  connect();
  for (int i = 0; i < 40; ++i) {
    now_ += 250 * kMillisecond;
    ASSERT_TRUE(asks());
    lease(2);
  }
  EXPECT_TRUE(conversation_.leased());
}

TEST_F(ConversationTest, GivesASilentServerUpAfterASecond) {
  connect();
  const Nanoseconds silent_since = now_;
  while (conversation_.leased() && now_ < silent_since + 10 * kSecond) {
    now_ = conversation_.wake_at();
    asks();
  }
  EXPECT_EQ(now_ - silent_since, kSecond);
  EXPECT_NE(conversation_.problem(), "");
}

TEST_F(ConversationTest, EndsALeaseThatNobodyRenews) {
  connect();
  for (int i = 0; i < 31; ++i) {  // frames still flow, but no answer comes
    now_ += 100 * kMillisecond;
    conversation_.heard(kSession, now_);
    asks();
  }
  EXPECT_FALSE(conversation_.leased());
}

TEST_F(ConversationTest, NoticesARestartByTheChallengeToItsProbe) {
  connect();
  now_ += 250 * kMillisecond;
  ASSERT_TRUE(asks());
  challenge(50, kSession + 1);
  EXPECT_FALSE(conversation_.leased());
  ASSERT_TRUE(asks());
  EXPECT_EQ(question_.token, 50u);
  lease(51, kSession + 1);
  EXPECT_TRUE(conversation_.leased());
  EXPECT_FALSE(conversation_.heard(kSession, now_)) << "a frame of the server that is gone";
}

TEST_F(ConversationTest, KeepsTheLeaseWhenOnlyTheTokenIsTooOld) {
  connect();
  now_ += kSecond;
  conversation_.heard(kSession, now_);
  ASSERT_TRUE(asks());
  challenge(50);
  EXPECT_TRUE(conversation_.leased());
  ASSERT_TRUE(asks());
  EXPECT_EQ(question_.token, 50u);
}

TEST_F(ConversationTest, SaysWhyItWasRefused) {
  ASSERT_TRUE(asks());
  conversation_.on(Notice{kSession, kNonce, false, "full"}, now_);
  EXPECT_EQ(conversation_.problem(), "full");
  EXPECT_FALSE(asks());
  now_ += kRetry;
  EXPECT_TRUE(asks());
}

TEST_F(ConversationTest, EndsWithTheServer) {
  connect();
  conversation_.on(Notice{kSession + 1, 0, true, "another server ends"}, now_);
  EXPECT_TRUE(conversation_.leased());
  conversation_.on(Notice{kSession, 0, true, "the server ends"}, now_);
  EXPECT_FALSE(conversation_.leased());
  EXPECT_EQ(conversation_.problem(), "the server ends");
}

TEST_F(ConversationTest, EndsWhenTheHostSaysThatNobodyListens) {
  connect();
  conversation_.refused(now_);
  EXPECT_FALSE(conversation_.leased());
  EXPECT_NE(conversation_.problem().find("fiducapd"), std::string::npos);
  EXPECT_EQ(conversation_.wake_at(), now_ + kRetry);
}

}  // namespace
}  // namespace fiducap::sdk
