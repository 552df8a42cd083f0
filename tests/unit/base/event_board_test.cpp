#include "base/event_board.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

Event lost(Severity severity = Severity::kWarning, std::string text = "lost, no image") {
  return {.severity = severity,
          .subject = "drone",
          .kind = "lost",
          .text = std::move(text),
          .remedy = "Look at the cable"};
}

class EventBoardTest : public testing::Test {
 protected:
  std::int64_t now_ns_{5'000'000'000};
  EventBoard board_{[this] { return now_ns_; }};
};

TEST_F(EventBoardTest, AConditionIsToldAtItsBeginAndAtItsEndHoweverOftenItIsLookedAt) {
  for (int i = 0; i < 100; ++i) board_.set(true, lost(), "back");
  ASSERT_EQ(board_.after(0).size(), 1U);
  EXPECT_EQ(board_.after(0)[0].sentence(), "drone: lost, no image. Look at the cable");
  EXPECT_EQ(board_.after(0)[0].utc_ms, 5000);
  ASSERT_EQ(board_.standing().size(), 1U);

  for (int i = 0; i < 100; ++i) board_.set(false, lost(), "back");
  ASSERT_EQ(board_.after(0).size(), 2U);
  EXPECT_TRUE(board_.after(1)[0].over);
  EXPECT_EQ(board_.after(1)[0].sentence(), "drone: back");
  EXPECT_THAT(board_.standing(), testing::IsEmpty());
}

TEST_F(EventBoardTest, AConditionThatGetsWorseIsToldAgainANewTextOnlyReplacesTheOld) {
  board_.begin(lost());
  board_.begin(lost(Severity::kWarning, "lost for 10 s"));
  EXPECT_EQ(board_.after(0).size(), 1U);
  EXPECT_EQ(board_.standing()[0].text, "lost for 10 s");
  board_.begin(lost(Severity::kError, "lost for good"));
  EXPECT_EQ(board_.after(0).size(), 2U);
  EXPECT_EQ(board_.standing()[0].severity, Severity::kError);
}

TEST_F(EventBoardTest, IsBoundedInEventsAndConditions) {
  for (int i = 0; i < 1000; ++i) {
    Event event = lost();
    event.subject = std::to_string(i);
    board_.begin(event);
  }
  EXPECT_EQ(board_.standing().size(), EventBoard::kStanding);
  const auto kept = board_.after(0);
  ASSERT_EQ(kept.size(), EventBoard::kKept);
  EXPECT_EQ(kept.back().number, 1000U);
}

TEST_F(EventBoardTest, TheRevisionChangesWithWhatWouldBeShownOnly) {
  board_.begin(lost());
  const auto revision = board_.revision();
  board_.begin(lost());
  board_.end("rover", "lost", "back");
  EXPECT_EQ(board_.revision(), revision);
  board_.end("drone", "lost", "back");
  EXPECT_NE(board_.revision(), revision);
}

}  // namespace
}  // namespace fiducap
