#include "streaming/web/live_connection.hpp"

#include <gtest/gtest.h>

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;

Message text(const char* content) { return std::make_shared<const std::string>(content); }

class LiveConnectionTest : public testing::Test {
 protected:
  std::string take() {
    const Message message = connection_.next(now_);
    if (!message) return "";
    connection_.written();
    return *message;
  }

  Instant now_ = instant_from_ns(1'000);
  LiveConnection connection_{net::Peer{0x7f000001, 5}, now_};
};

TEST_F(LiveConnectionTest, HelloLeavesFirstWhateverCameFirst) {
  connection_.offer_log(text("log"), 3);
  connection_.offer(Topic::kClients, text("clients"));
  connection_.offer(Topic::kFrame, text("frame"));
  connection_.offer(Topic::kMap, text("map"));
  connection_.offer(Topic::kHello, text("hello"));
  for (const char* expected : {"hello", "map", "frame", "clients", "log", ""})
    EXPECT_EQ(take(), expected);
}

TEST_F(LiveConnectionTest, NewestFrameWinsAndTheOlderOneIsCounted) {
  connection_.offer(Topic::kFrame, text("1"));
  connection_.offer(Topic::kFrame, text("2"));
  connection_.offer(Topic::kFrame, text("3"));
  EXPECT_EQ(take(), "3");
  EXPECT_EQ(take(), "");
  EXPECT_EQ(connection_.status(now_).frames_sent, 1);
  EXPECT_EQ(connection_.status(now_).frames_dropped, 2);
}

TEST_F(LiveConnectionTest, OneMessageIsUnderWayAtATime) {
  connection_.offer(Topic::kHello, text("hello"));
  connection_.offer(Topic::kFrame, text("frame"));
  ASSERT_NE(connection_.next(now_), nullptr);
  EXPECT_EQ(connection_.next(now_), nullptr);
  connection_.written();
  EXPECT_EQ(take(), "frame");
}

TEST_F(LiveConnectionTest, WaitingLogLinesAreNeverReplaced) {
  EXPECT_EQ(connection_.log_wanted_after(), 0);
  connection_.offer_log(text("lines"), 17);
  EXPECT_EQ(connection_.log_wanted_after(), std::nullopt);
  EXPECT_EQ(take(), "lines");
  EXPECT_EQ(connection_.log_wanted_after(), 17);
}

TEST_F(LiveConnectionTest, IsStuckOnlyWhileOneWriteTakesTooLong) {
  EXPECT_FALSE(connection_.stuck(now_ + 1h, 5s));
  connection_.offer(Topic::kFrame, text("frame"));
  ASSERT_NE(connection_.next(now_), nullptr);
  EXPECT_FALSE(connection_.stuck(now_ + 5s, 5s));
  EXPECT_TRUE(connection_.stuck(now_ + 6s, 5s));
  connection_.written();
  EXPECT_FALSE(connection_.stuck(now_ + 6s, 5s));
}

TEST_F(LiveConnectionTest, StatusTellsPeerAndTimeConnected) {
  const auto status = connection_.status(now_ + 2500ms);
  EXPECT_EQ(status.protocol, "web");
  EXPECT_EQ(status.peer, "127.0.0.1:5 tcp");
  EXPECT_EQ(status.connected_s, 2.5);
}

}  // namespace
}  // namespace fiducap::web
