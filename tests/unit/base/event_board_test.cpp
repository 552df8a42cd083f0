#include "base/event_board.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <future>
#include <optional>

namespace fiducap {
namespace {

using testing::Contains;
using testing::ElementsAre;
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

/// A board whose conditions must hold for a second, looked at four times a second.
class HoldingBoardTest : public EventBoardTest {
 protected:
  /// @param each  done before each look
  template <typename Each>
  void pass(Duration d, Each each) {
    for (const Instant end = now_ + d; now_ < end; now_ += std::chrono::milliseconds(250)) {
      each();
      holding_.settle(now_);
    }
  }
  void pass_lost(Duration d) {
    pass(d, [this] { holding_.set(true, lost(), "back"); });
  }
  void pass_well(Duration d) {
    pass(d, [this] { holding_.set(false, lost(), "back"); });
  }
  std::vector<std::string> texts() {
    std::vector<std::string> all;
    for (const Event& event : holding_.after(0)) all.push_back(event.text);
    return all;
  }

  Instant now_{};
  EventBoard holding_{[this] { return now_ns_; }, std::chrono::seconds(1)};
};

TEST_F(HoldingBoardTest, PublishesWhatHoldsForASecond) {
  pass_lost(std::chrono::seconds(1));
  EXPECT_THAT(texts(), IsEmpty());
  pass_lost(std::chrono::seconds(1));
  EXPECT_THAT(texts(), ElementsAre("lost, no image"));
  EXPECT_EQ(holding_.standing().size(), 1U);
  pass_well(std::chrono::seconds(1));
  EXPECT_EQ(holding_.standing().size(), 1U);
  pass_well(std::chrono::seconds(1));
  EXPECT_THAT(texts(), ElementsAre("lost, no image", "back"));
  EXPECT_THAT(holding_.standing(), IsEmpty());
}

TEST_F(HoldingBoardTest, DoesNotFlicker) {
  for (int i = 0; i < 20; ++i) {
    pass_lost(std::chrono::milliseconds(750));
    pass_well(std::chrono::milliseconds(750));
  }
  EXPECT_THAT(texts(), IsEmpty());
  pass_lost(std::chrono::seconds(2));
  for (int i = 0; i < 20; ++i) {
    pass_well(std::chrono::milliseconds(750));
    pass_lost(std::chrono::milliseconds(750));
  }
  EXPECT_THAT(texts(), ElementsAre("lost, no image"));
}

TEST_F(HoldingBoardTest, PublishesErrorsAtOnce) {
  holding_.begin(lost());
  holding_.begin(lost(Severity::kError, "lost for good"));
  EXPECT_THAT(texts(), ElementsAre("lost for good"));
  pass(std::chrono::seconds(3), [] {});
  EXPECT_THAT(texts(), ElementsAre("lost for good"));
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
