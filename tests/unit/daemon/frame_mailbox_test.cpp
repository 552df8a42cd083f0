#include "daemon/stream_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <thread>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

class FrameMailboxTest : public testing::Test {
 protected:
  boost::asio::io_context io_;
  std::vector<std::uint64_t> received_;
  FrameMailbox mailbox_{io_, [this](const auto& frame) { received_.push_back(frame->number); }};
};

TEST_F(FrameMailboxTest, DeliversAFrameOnTheIoThread) {
  mailbox_.put(make_scene_frame({"robot"}, 7));
  EXPECT_TRUE(received_.empty());
  io_.poll();
  EXPECT_EQ(received_, std::vector<std::uint64_t>{7});
}

TEST_F(FrameMailboxTest, KeepsOnlyTheNewestFrame) {
  for (std::uint64_t number = 1; number <= 5; ++number)
    mailbox_.put(make_scene_frame({"robot"}, number));
  io_.poll();
  EXPECT_EQ(received_, std::vector<std::uint64_t>{5});
}

TEST_F(FrameMailboxTest, LetsGoOfAFrameThatWasReplaced) {
  auto first = make_scene_frame({"robot"}, 1);
  const std::weak_ptr<const SceneFrame> watched = first;
  mailbox_.put(std::move(first));
  mailbox_.put(make_scene_frame({"robot"}, 2));
  EXPECT_TRUE(watched.expired());
}

TEST_F(FrameMailboxTest, DeliversNothingAfterItWasClosed) {
  mailbox_.put(make_scene_frame({"robot"}, 1));
  mailbox_.close();
  io_.poll();
  EXPECT_TRUE(received_.empty());
}

TEST_F(FrameMailboxTest, AllocatesNothingPerFrameAfterWarmUp) {
  const std::shared_ptr<const SceneFrame> frame = make_scene_frame({"robot"});
  received_.reserve(1000);
  for (int i = 0; i < 10; ++i) {
    mailbox_.put(frame);
    io_.poll();
  }
  const AllocationCounter allocations;
  for (int i = 0; i < 100; ++i) {
    mailbox_.put(frame);
    io_.poll();
  }
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(received_.size(), 110u);
}

TEST_F(FrameMailboxTest, BetweenTwoThreadsFramesComeInOrderAndTheLastOneComes) {
  constexpr std::uint64_t kFrames = 20'000;
  const std::jthread publisher([&] {
    for (std::uint64_t number = 1; number <= kFrames; ++number)
      mailbox_.put(make_scene_frame({"robot"}, number));
  });
  while (received_.empty() || received_.back() != kFrames) io_.run_one();
  EXPECT_TRUE(std::is_sorted(received_.begin(), received_.end()));
  EXPECT_EQ(std::adjacent_find(received_.begin(), received_.end()), received_.end());
}

}  // namespace
}  // namespace fiducap
