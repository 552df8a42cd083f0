#include "base/event_board.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <future>
#include <optional>

namespace fiducap {
namespace {

using testing::Contains;
using testing::Field;
using testing::IsEmpty;
using testing::Not;

Event lost(Severity severity = Severity::kWarning, std::string text = "lost, no image") {
  return {.severity = severity,
          .subject = "drone",
          .kind = "lost",
          .text = std::move(text),
          .remedy = "Look at the cable"};
}
Event lost_of(const std::string& subject, Severity severity = Severity::kWarning) {
  Event event = lost(severity);
  event.subject = subject;
  return event;
}
auto has_subject(const std::string& subject) { return Contains(Field(&Event::subject, subject)); }
auto has_kind(const std::string& kind) { return Contains(Field(&Event::kind, kind)); }

class EventBoardTest : public testing::Test {
 protected:
  /// Conditions of the subjects 0, 1 …
  void begin(int subjects) {
    for (int i = 0; i < subjects; ++i) board_.begin(lost_of(std::to_string(i)));
  }
  /// The only condition.
  [[nodiscard]] Event condition() const {
    EXPECT_EQ(board_.standing().size(), 1U);
    return board_.standing().at(0);
  }
  std::int64_t now_ns_{5'000'000'000};
  EventBoard board_{[this] { return now_ns_; }};
};

TEST_F(EventBoardTest, ConditionIsReportedAtItsBeginAndEndOnly) {
  for (int i = 0; i < 100; ++i) board_.set(true, lost(), "back");
  ASSERT_EQ(board_.after(0).size(), 1U);
  EXPECT_EQ(board_.after(0)[0].sentence(), "drone: lost, no image. Look at the cable");
  EXPECT_EQ(board_.after(0)[0].utc_ms, 5000);
  EXPECT_EQ(condition().kind, "lost");

  for (int i = 0; i < 100; ++i) board_.set(false, lost(), "back");
  ASSERT_EQ(board_.after(0).size(), 2U);
  EXPECT_TRUE(board_.after(1)[0].over);
  EXPECT_EQ(board_.after(1)[0].sentence(), "drone: back");
  EXPECT_THAT(board_.standing(), IsEmpty());
}

TEST_F(EventBoardTest, HigherSeverityIsReportedAgain) {
  board_.begin(lost());
  board_.begin(lost(Severity::kWarning, "lost for 10 s"));
  EXPECT_EQ(board_.after(0).size(), 1U) << "a text is only replaced";
  EXPECT_EQ(condition().text, "lost for 10 s");
  board_.begin(lost(Severity::kError, "lost for good"));
  EXPECT_EQ(board_.after(0).size(), 2U);
  EXPECT_EQ(condition().severity, Severity::kError);
}

TEST_F(EventBoardTest, TextRemedyAndSeverityBelongToOneCause) {
  board_.begin(lost(Severity::kError));
  const Event coasts{.severity = Severity::kWarning,
                     .subject = "drone",
                     .kind = "lost",
                     .text = "coasts",
                     .remedy = "Show it a tag"};
  board_.begin(coasts);
  EXPECT_EQ(board_.after(0).size(), 1U) << "a lower severity is no event";
  EXPECT_EQ(condition().sentence(), coasts.sentence());
  EXPECT_EQ(condition().severity, Severity::kWarning);
  board_.begin(lost(Severity::kError));
  EXPECT_EQ(board_.after(0).size(), 2U) << "it is worse again";
}

TEST_F(EventBoardTest, EventsAndConditionsAreBounded) {
  begin(1000);
  EXPECT_EQ(board_.standing().size(), EventBoard::kStanding);
  for (int i = 0; i < 1000; ++i) board_.report(lost());
  const auto kept = board_.after(0);
  ASSERT_EQ(kept.size(), EventBoard::kKept);
  EXPECT_EQ(kept.back().number, 1000U + EventBoard::kStanding);
}

TEST_F(EventBoardTest, ConditionsBeyondTheLimitAreOneCondition) {
  begin(300);
  const auto counts = board_.counts();
  EXPECT_EQ(counts[1], EventBoard::kStanding);
  EXPECT_THAT(board_.standing(), has_kind("crowded"));
  for (int i = 0; i < 100; ++i) begin(300);
  EXPECT_EQ(board_.counts(), counts);
}

TEST_F(EventBoardTest, ErrorDisplacesALowerSeverity) {
  begin(300);
  board_.begin(lost_of("map", Severity::kError));
  EXPECT_EQ(board_.standing().size(), EventBoard::kStanding);
  EXPECT_THAT(board_.standing(), Contains(Field(&Event::subject, "map")).Times(1));
  EXPECT_THAT(board_.standing(), has_kind("crowded"));
  begin(300);
  EXPECT_EQ(board_.counts()[2], 1U);
  EXPECT_EQ(board_.counts()[1], EventBoard::kStanding) << "the displaced one is not reported again";
}

TEST_F(EventBoardTest, WaitingConditionsAreReportedWhenThereIsRoom) {
  begin(300);
  for (int i = 0; i < 200; ++i) board_.end(std::to_string(i), "lost", "back");
  EXPECT_THAT(board_.standing(), Not(has_kind("crowded")));
  begin(300);
  EXPECT_THAT(board_.standing(), has_kind("crowded"));
  EXPECT_THAT(board_.standing(), Not(has_subject("299"))) << "the first have the places";
}

TEST_F(EventBoardTest, RenamedSubjectHasItsNewName) {
  board_.begin(lost());
  const auto revision = board_.revision();
  board_.rename("drone", "uav1");
  EXPECT_NE(board_.revision(), revision);
  EXPECT_EQ(condition().subject, "uav1");
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
  EXPECT_EQ(condition().subject, "drone");
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

TEST_F(EventBoardTest, SnapshotIsImmutable) {
  std::shared_ptr<const EventSnapshot> snapshot;
  board_.refresh(snapshot);
  const auto empty = snapshot;
  board_.begin(lost());
  EXPECT_THAT(empty->standing, IsEmpty());
  board_.refresh(snapshot);
  EXPECT_EQ(snapshot->revision, board_.revision());
  EXPECT_EQ(snapshot->standing.size(), 1U);
  EXPECT_EQ(snapshot->after(0).size(), 1U);
  EXPECT_EQ(snapshot->after(1).size(), 0U);
}

TEST_F(EventBoardTest, RevisionChangesOnlyWithItsContent) {
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
