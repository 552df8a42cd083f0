#include "base/event_board.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <optional>

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

TEST_F(EventBoardTest, AConditionIsReportedAtItsBeginAndAtItsEndHoweverOftenItIsSet) {
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

TEST_F(EventBoardTest, AHigherSeverityIsReportedAgainOtherwiseTheTextIsReplaced) {
  board_.begin(lost());
  board_.begin(lost(Severity::kWarning, "lost for 10 s"));
  EXPECT_EQ(board_.after(0).size(), 1U);
  EXPECT_EQ(board_.standing()[0].text, "lost for 10 s");
  board_.begin(lost(Severity::kError, "lost for good"));
  EXPECT_EQ(board_.after(0).size(), 2U);
  EXPECT_EQ(board_.standing()[0].severity, Severity::kError);
}

TEST_F(EventBoardTest, TextRemedyAndSeverityAreThoseOfOneCause) {
  board_.begin(lost(Severity::kError));
  const Event carried{.severity = Severity::kWarning,
                      .subject = "drone",
                      .kind = "lost",
                      .text = "is carried on",
                      .remedy = "Show it a tag"};
  board_.begin(carried);
  EXPECT_EQ(board_.after(0).size(), 1U) << "a lower severity is no event";
  ASSERT_EQ(board_.standing().size(), 1U);
  EXPECT_EQ(board_.standing()[0].sentence(), carried.sentence());
  EXPECT_EQ(board_.standing()[0].severity, Severity::kWarning);
  board_.begin(lost(Severity::kError));
  EXPECT_EQ(board_.after(0).size(), 2U) << "it is worse again";
}

TEST_F(EventBoardTest, IsBoundedInEventsAndConditions) {
  for (int i = 0; i < 1000; ++i) {
    Event event = lost();
    event.subject = std::to_string(i);
    board_.begin(event);
  }
  EXPECT_EQ(board_.standing().size(), EventBoard::kStanding);
  for (int i = 0; i < 1000; ++i) board_.report(lost());
  const auto kept = board_.after(0);
  ASSERT_EQ(kept.size(), EventBoard::kKept);
  EXPECT_EQ(kept.back().number, 1000U + EventBoard::kStanding);
}

class FullEventBoard : public EventBoardTest {
 protected:
  void begin(int bodies, Severity severity = Severity::kWarning) {
    for (int i = 0; i < bodies; ++i) {
      Event event = lost(severity);
      event.subject = std::to_string(i);
      board_.begin(event);
    }
  }
  bool reports_overflow() {
    const auto standing = board_.standing();
    return std::any_of(standing.begin(), standing.end(),
                       [](const Event& event) { return event.kind == "crowded"; });
  }
};

TEST_F(FullEventBoard, ConditionsWithoutAPlaceAreOneConditionHoweverOftenTheyBegin) {
  begin(300);
  const auto counts = board_.counts();
  EXPECT_EQ(counts[1], EventBoard::kStanding);
  EXPECT_TRUE(reports_overflow());
  for (int i = 0; i < 100; ++i) begin(300);
  EXPECT_EQ(board_.counts(), counts);
}

TEST_F(FullEventBoard, AnErrorDisplacesALowerSeverity) {
  begin(300);
  Event worse = lost(Severity::kError);
  worse.subject = "map";
  board_.begin(worse);
  const auto standing = board_.standing();
  EXPECT_EQ(standing.size(), EventBoard::kStanding);
  EXPECT_EQ(std::count_if(standing.begin(), standing.end(),
                          [](const Event& event) { return event.subject == "map"; }),
            1);
  EXPECT_TRUE(reports_overflow());
  begin(300);
  EXPECT_EQ(board_.counts()[2], 1U);
  EXPECT_EQ(board_.counts()[1], EventBoard::kStanding) << "the displaced one is not reported again";
}

TEST_F(FullEventBoard, WaitingConditionsAreReportedWhenThereIsRoom) {
  begin(300);
  for (int i = 0; i < 200; ++i) board_.end(std::to_string(i), "lost", "back");
  EXPECT_FALSE(reports_overflow());
  begin(300);
  EXPECT_TRUE(reports_overflow());
  const auto standing = board_.standing();
  EXPECT_EQ(std::count_if(standing.begin(), standing.end(),
                          [](const Event& event) { return event.subject == "299"; }),
            0)
      << "the first come first";
}

TEST_F(EventBoardTest, ARenamedSubjectIsShownUnderItsNewName) {
  board_.begin(lost());
  const auto revision = board_.revision();
  board_.rename("drone", "uav1");
  EXPECT_NE(board_.revision(), revision);
  ASSERT_EQ(board_.standing().size(), 1U);
  EXPECT_EQ(board_.standing()[0].subject, "uav1");
  EXPECT_EQ(board_.after(0)[0].subject, "drone") << "as it was reported";

  board_.begin(lost());
  EXPECT_EQ(board_.after(0).size(), 1U) << "it is the same";
  board_.begin(lost(Severity::kError));
  EXPECT_EQ(board_.after(1).at(0).subject, "uav1");
  board_.begin({.severity = Severity::kError, .subject = "rover", .kind = "lost", .text = "lost"});
  board_.rename("rover", "drone");
  EXPECT_EQ(board_.standing().size(), 2U) << "a name that is free";
  board_.end("drone", "lost", "back");
  EXPECT_EQ(board_.after(0).back().subject, "uav1");
  ASSERT_EQ(board_.standing().size(), 1U);
  EXPECT_EQ(board_.standing()[0].subject, "drone");
}

TEST(EventBoard, ReadersDoNotWaitForWriters) {
  std::vector<std::future<void>> readers;
  std::future_status was_read{};
  std::optional<EventBoard> board;
  board.emplace([&] {  // called in the middle of writing
    readers.push_back(std::async(std::launch::async, [&] {
      (void)board->revision();
      (void)board->standing();
      (void)board->after(0);
      (void)board->counts();
    }));
    was_read = readers.back().wait_for(std::chrono::seconds(10));
    return std::int64_t{0};
  });
  board->begin(lost());
  EXPECT_EQ(was_read, std::future_status::ready);
}

TEST_F(EventBoardTest, ASnapshotIsImmutable) {
  std::shared_ptr<const EventSnapshot> snapshot;
  board_.refresh(snapshot);
  const auto empty = snapshot;
  board_.begin(lost());
  EXPECT_THAT(empty->standing, testing::IsEmpty());
  board_.refresh(snapshot);
  EXPECT_EQ(snapshot->revision, board_.revision());
  ASSERT_EQ(snapshot->standing.size(), 1U);
  EXPECT_EQ(snapshot->after(0).size(), 1U);
  EXPECT_EQ(snapshot->after(1).size(), 0U);
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
