#include "streaming/vrpn/outbox.hpp"

#include <gtest/gtest.h>

#include "streaming/vrpn/codec.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::vrpn {
namespace {

using std::chrono::milliseconds;
using Bytes = std::vector<std::byte>;

constexpr Instant kStart{};

std::shared_ptr<EncodedFrame> frame_of(std::int32_t sender, int messages = 1) {
  auto frame = std::make_shared<EncodedFrame>();
  for (int i = 0; i < messages; ++i) encode_pos_quat({0, sender, 4, 0}, 0, Pose{}, frame->bytes);
  frame->datagram_ends = {frame->bytes.size()};
  return frame;
}

std::vector<Header> headers(std::span<const std::byte> bytes) {
  std::vector<Header> all;
  while (!bytes.empty()) {
    const auto message = decode_message(bytes);
    if (!message) {
      ADD_FAILURE() << message.error().text();
      break;
    }
    all.push_back(message->header);
    bytes = bytes.subspan(message->size);
  }
  return all;
}

class OutboxTest : public testing::Test {
 protected:
  Outbox outbox_;
  Bytes out_;
};

TEST_F(OutboxTest, SendsCookieThenReliableThenReportsCountedOn) {
  Bytes cookie;
  encode_cookie(35, cookie);
  outbox_.greet(cookie);
  encode_empty({0, 1, 17, 0}, outbox_.reliable());
  EXPECT_TRUE(outbox_.offer(frame_of(2)));
  ASSERT_TRUE(outbox_.take(kStart, out_));
  EXPECT_EQ(Bytes(out_.begin(), out_.begin() + 24), cookie);
  const auto sent = headers(std::span(out_).subspan(24));
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(sent[0], (Header{0, 1, 17, 0}));
  EXPECT_EQ(sent[1], (Header{0, 2, 4, 1}));
}

TEST_F(OutboxTest, GivesNothingWhileAWriteIsOnItsWay) {
  outbox_.offer(frame_of(1));
  ASSERT_TRUE(outbox_.take(kStart, out_));
  outbox_.offer(frame_of(1));
  Bytes second;
  EXPECT_FALSE(outbox_.take(kStart, second));
  outbox_.written(kStart);
  EXPECT_TRUE(outbox_.take(kStart, second));
  EXPECT_FALSE(outbox_.take(kStart, second));
}

TEST_F(OutboxTest, KeepsOnlyTheNewestFrameAndCountsWithoutHoles) {
  outbox_.offer(frame_of(1));
  ASSERT_TRUE(outbox_.take(kStart, out_));
  EXPECT_TRUE(outbox_.offer(frame_of(2)));
  EXPECT_FALSE(outbox_.offer(frame_of(3)));
  EXPECT_FALSE(outbox_.offer(frame_of(4)));
  outbox_.written(kStart);
  ASSERT_TRUE(outbox_.take(kStart, out_));
  const auto sent = headers(out_);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0], (Header{0, 4, 4, 1}));
}

TEST_F(OutboxTest, KeepsEveryReliableMessage) {
  outbox_.offer(frame_of(1));
  ASSERT_TRUE(outbox_.take(kStart, out_));
  for (int i = 0; i < 100; ++i) encode_empty({0, i, 17, 0}, outbox_.reliable());
  outbox_.written(kStart);
  ASSERT_TRUE(outbox_.take(kStart, out_));
  EXPECT_EQ(headers(out_).size(), 100u);
}

TEST_F(OutboxTest, AStuckFrameAloneIsNoReasonToClose) {
  outbox_.offer(frame_of(1));
  ASSERT_TRUE(outbox_.take(kStart, out_));
  outbox_.offer(frame_of(1));
  EXPECT_FALSE(outbox_.overdue(kStart + std::chrono::hours(1)));
}

TEST_F(OutboxTest, AReliableMessageStuckForTwoSecondsIs) {
  outbox_.offer(frame_of(1));
  ASSERT_TRUE(outbox_.take(kStart, out_));
  encode_empty({0, 1, 17, 0}, outbox_.reliable());
  EXPECT_FALSE(outbox_.overdue(kStart + milliseconds(500)));  // seen waiting from here on
  EXPECT_FALSE(outbox_.overdue(kStart + milliseconds(2400)));
  const auto why = outbox_.overdue(kStart + milliseconds(2600));
  ASSERT_TRUE(why);
  EXPECT_NE(why->find("2 s"), std::string::npos);
}

TEST_F(OutboxTest, SoIsOneOnItsWay) {
  encode_empty({0, 1, 17, 0}, outbox_.reliable());
  ASSERT_TRUE(outbox_.take(kStart, out_));
  EXPECT_FALSE(outbox_.overdue(kStart + milliseconds(1900)));
  EXPECT_TRUE(outbox_.overdue(kStart + milliseconds(2100)));
  outbox_.written(kStart + milliseconds(2200));
  EXPECT_FALSE(outbox_.overdue(kStart + milliseconds(9000)));
}

TEST_F(OutboxTest, MoreThanAMebibyteOfReliableDataIs) {
  outbox_.offer(frame_of(1));
  ASSERT_TRUE(outbox_.take(kStart, out_));
  outbox_.reliable().resize(Outbox::kMaxReliableBytes);
  EXPECT_FALSE(outbox_.overdue(kStart));
  outbox_.reliable().resize(Outbox::kMaxReliableBytes + 1);
  EXPECT_TRUE(outbox_.overdue(kStart));
}

TEST_F(OutboxTest, AllocatesNothingAfterWarmUp) {
  const auto frame = frame_of(1, 20);
  const auto round = [&] {
    outbox_.offer(frame);
    encode_empty({0, 1, 17, 0}, outbox_.reliable());
    outbox_.take(kStart, out_);
    outbox_.written(kStart);
  };
  round();
  const AllocationCounter allocations;
  for (int i = 0; i < 100; ++i) round();
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap::vrpn
