#include "src/conversation.hpp"

#include <gmock/gmock.h>

namespace fiducap::sdk {
namespace {

constexpr Nanoseconds kRetry = 500 * kMillisecond;
constexpr std::uint64_t kNonce = 42;
constexpr std::uint64_t kSession = 7;
constexpr std::uint64_t kModel = 1;

class ConversationTest : public testing::Test {
 protected:
  ConversationTest() { conversation_.start(now_); }

  /// @return whether a request is due
  bool requests(std::uint64_t model = kModel) {
    conversation_.tick(now_);
    if (!conversation_.due(now_)) return false;
    request_ = conversation_.question(model, now_);
    return true;
  }
  bool requests_after(Nanoseconds delay, std::uint64_t model = kModel) {
    now_ += delay;
    return requests(model);
  }
  /// A frame arrives.
  bool heard_after(Nanoseconds delay, std::uint64_t session = kSession) {
    now_ += delay;
    return conversation_.heard(session, now_);
  }
  void challenge(std::uint64_t token, std::uint64_t session = kSession) {
    conversation_.on(Challenge{token, kNonce, session}, now_);
  }
  void lease(std::uint64_t token, std::uint64_t session = kSession) {
    EXPECT_TRUE(conversation_.on(Lease{session, kNonce, token, 3 * kSecond, kModel}, now_));
  }
  void subscribe() {
    ASSERT_TRUE(requests(0));
    challenge(1);
    ASSERT_TRUE(requests(0));
    EXPECT_EQ(request_.token, 1u);
    lease(2);
  }
  void connect() {
    subscribe();
    heard_after(100 * kMillisecond);
    ASSERT_TRUE(requests()) << "once more, to confirm the model";
    lease(2);
  }

  Nanoseconds now_ = 1000 * kSecond;
  Conversation conversation_{kRetry, kNonce, "test"};
  SubscribeRequest request_;
};

TEST_F(ConversationTest, RequestsAtOnceAndThenOncePerPause) {
  EXPECT_TRUE(requests());
  EXPECT_EQ(request_.token, 0u);
  EXPECT_EQ(request_.nonce, kNonce);
  EXPECT_EQ(request_.client_name, "test");
  EXPECT_FALSE(requests());
  EXPECT_FALSE(requests_after(kRetry - 1));
  EXPECT_TRUE(requests_after(1));
  EXPECT_EQ(conversation_.unanswered(), 2);
}

TEST_F(ConversationTest, IgnoresRepliesWithAnotherNonce) {
  ASSERT_TRUE(requests());
  conversation_.on(Challenge{99, kNonce + 1, kSession}, now_);
  EXPECT_FALSE(requests());
  EXPECT_FALSE(conversation_.on(Lease{kSession, kNonce + 1, 1, kSecond, kModel}, now_));
  conversation_.on(Notice{kSession, kNonce + 1, true, "no"}, now_);
  EXPECT_FALSE(conversation_.leased());
}

TEST_F(ConversationTest, RequestsAreBoundedWhenEveryReplyIsAChallenge) {
  int count = 0;
  for (int ms = 0; ms < 1000; ++ms, now_ += kMillisecond) {
    if (!requests()) continue;
    ++count;
    challenge(1);
  }
  EXPECT_LE(count, 25);
}

TEST_F(ConversationTest, RequestsAMissingModelSoon) {
  subscribe();
  ASSERT_TRUE(requests_after(100 * kMillisecond, 0));
  EXPECT_EQ(request_.token, 2u);
  EXPECT_EQ(request_.model_generation, 0u);
}

TEST_F(ConversationTest, RenewsThreeTimesPerLeaseWhileFramesFlow) {
  connect();
  int count = 0;
  for (int i = 0; i < 300; ++i) {
    EXPECT_TRUE(heard_after(10 * kMillisecond));
    if (requests()) {
      ++count;
      lease(2);
    }
    ASSERT_TRUE(conversation_.leased());
  }
  EXPECT_EQ(count, 3);
}

TEST_F(ConversationTest, ProbesASilentServerAndKeepsTheLease) {
  connect();
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(requests_after(250 * kMillisecond));
    lease(2);
  }
  EXPECT_TRUE(conversation_.leased());
}

TEST_F(ConversationTest, LeaseOfASilentServerEndsAfterASecond) {
  connect();
  const Nanoseconds silent_since = now_;
  while (conversation_.leased() && now_ < silent_since + 10 * kSecond) {
    now_ = conversation_.wake_at();
    requests();
  }
  EXPECT_EQ(now_ - silent_since, kSecond);
  EXPECT_NE(conversation_.problem(), "");
}

TEST_F(ConversationTest, LeaseEndsUnlessRenewed) {
  connect();
  for (int i = 0; i < 31; ++i) {  // frames still flow, but no reply comes
    heard_after(100 * kMillisecond);
    requests();
  }
  EXPECT_FALSE(conversation_.leased());
}

TEST_F(ConversationTest, ChallengeOfAnotherSessionIsARestart) {
  connect();
  ASSERT_TRUE(requests_after(250 * kMillisecond));
  challenge(50, kSession + 1);
  EXPECT_FALSE(conversation_.leased());
  ASSERT_TRUE(requests());
  EXPECT_EQ(request_.token, 50u);
  lease(51, kSession + 1);
  EXPECT_TRUE(conversation_.leased());
  EXPECT_FALSE(heard_after(0)) << "a frame of the former server";
}

TEST_F(ConversationTest, ChallengeOfTheSameSessionKeepsTheLease) {
  connect();
  heard_after(kSecond);
  ASSERT_TRUE(requests());
  challenge(50);
  EXPECT_TRUE(conversation_.leased());
  ASSERT_TRUE(requests());
  EXPECT_EQ(request_.token, 50u);
}

TEST_F(ConversationTest, RefusalIsReportedAndRetried) {
  ASSERT_TRUE(requests());
  conversation_.on(Notice{kSession, kNonce, false, "full"}, now_);
  EXPECT_EQ(conversation_.problem(), "full");
  EXPECT_FALSE(requests());
  EXPECT_TRUE(requests_after(kRetry));
}

TEST_F(ConversationTest, LeaseEndsWithTheServer) {
  connect();
  conversation_.on(Notice{kSession + 1, 0, true, "another server ends"}, now_);
  EXPECT_TRUE(conversation_.leased());
  conversation_.on(Notice{kSession, 0, true, "the server ends"}, now_);
  EXPECT_FALSE(conversation_.leased());
  EXPECT_EQ(conversation_.problem(), "the server ends");
}

TEST_F(ConversationTest, LeaseEndsWhenThePortIsClosed) {
  connect();
  conversation_.refused(now_);
  EXPECT_FALSE(conversation_.leased());
  EXPECT_THAT(conversation_.problem(), testing::HasSubstr("fiducapd"));
  EXPECT_EQ(conversation_.wake_at(), now_ + kRetry);
}

}  // namespace
}  // namespace fiducap::sdk
