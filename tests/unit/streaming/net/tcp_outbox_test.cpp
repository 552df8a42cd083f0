#include "streaming/net/tcp_outbox.hpp"

#include <gtest/gtest.h>

#include <string>

namespace fiducap::net {
namespace {

constexpr Instant kStart = instant_from_ns(1'000'000'000);

std::vector<std::byte> bytes(std::string_view text) {
  const auto view = std::as_bytes(std::span(text.data(), text.size()));
  return {view.begin(), view.end()};
}
SharedBytes frame(std::string_view text) {
  return std::make_shared<const std::vector<std::byte>>(bytes(text));
}

class TcpOutboxTest : public testing::Test {
 protected:
  std::string take(Instant now = kStart) {
    const auto pieces = outbox_.take(now);
    std::string text = pieces ? "" : "nothing";
    if (pieces) {
      for (const auto& piece : *pieces)
        text.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    }
    return text;
  }
  TcpOutbox outbox_;
};

TEST_F(TcpOutboxTest, RepliesGoBeforeTheFrame) {
  outbox_.offer(frame("frame"));
  outbox_.reply(bytes("reply,"));
  EXPECT_EQ(take(), "reply,frame");
}

TEST_F(TcpOutboxTest, OfFramesOnlyTheNewestWaits) {
  EXPECT_TRUE(outbox_.offer(frame("old")));
  EXPECT_FALSE(outbox_.offer(frame("new")));
  EXPECT_EQ(take(), "new");
}

TEST_F(TcpOutboxTest, WhatIsUnderWayStaysWholeWhileMoreArrives) {
  outbox_.reply(bytes("one"));
  outbox_.offer(frame("1"));
  const auto pieces = outbox_.take(kStart);
  outbox_.reply(bytes("two"));
  EXPECT_TRUE(outbox_.offer(frame("2"))) << "the frame under way is not lost";
  EXPECT_EQ(take(), "nothing") << "one write at a time";
  EXPECT_EQ(std::string(reinterpret_cast<const char*>((*pieces)[0].data()), 3), "one");
  outbox_.written(kStart);
  EXPECT_EQ(take(), "two2");
}

TEST_F(TcpOutboxTest, AClientThatDoesNotReadMustGo) {
  outbox_.offer(frame("1"));
  take();
  EXPECT_FALSE(outbox_.overdue(kStart + TcpOutbox::kMaxWait));
  EXPECT_TRUE(outbox_.overdue(kStart + TcpOutbox::kMaxWait + Duration(1)));
}

TEST_F(TcpOutboxTest, RepliesThatPileUpEndItToo) {
  outbox_.reply(std::vector<std::byte>(TcpOutbox::kMaxReplyBytes));
  EXPECT_FALSE(outbox_.overdue(kStart));
  outbox_.reply(bytes("x"));
  EXPECT_TRUE(outbox_.overdue(kStart));
}

TEST_F(TcpOutboxTest, AReaderThatKeepsUpIsNeverOverdue) {
  for (int second = 0; second < 20; ++second) {
    const Instant now = kStart + std::chrono::seconds(second);
    outbox_.offer(frame("f"));
    outbox_.reply(bytes("r"));
    EXPECT_EQ(take(now), "rf");
    EXPECT_FALSE(outbox_.overdue(now));
    outbox_.written(now);
  }
}

}  // namespace
}  // namespace fiducap::net
