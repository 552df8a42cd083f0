// Events of the server's board, to the client over a real loopback socket.
#include "fiducap/events.hpp"

#include <gmock/gmock.h>

#include <optional>

#include "fiducap/control.hpp"
#include "support/fake_operator_api.hpp"
#include "test_server.hpp"

namespace fiducap {
namespace {

constexpr std::chrono::milliseconds kAtOnce{0};

class EventWatchTest : public testing::Test {
 protected:
  EventOptions options(bool history = true) const {
    EventOptions made;
    made.port = server_->port();
    made.history = history;
    return made;
  }
  void start(std::uint16_t port = 0) {
    server_.emplace(*scene_, port, native::NativeConfig{}, &operator_api_, nullptr, &*board_);
  }
  void begin_lost() {
    board_->begin({.severity = Severity::kError,
                   .subject = "drone",
                   .kind = "lost",
                   .text = "lost, sees no tags",
                   .remedy = "Look at the camera."});
  }
  void report(const std::string& kind) {
    board_->report({.subject = "server", .kind = kind, .text = kind});
  }
  /// The next event.
  void expect(EventWatch& watch, const std::string& kind) {
    ASSERT_TRUE(watch.next(event_, kTimeout)) << watch.problem();
    EXPECT_EQ(event_.kind, kind);
  }

  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone"});
  std::optional<EventBoard> board_{[] { return std::int64_t{1'700'000'000'123'000'000}; }};
  FakeOperatorApi operator_api_;
  std::optional<TestServer> server_;
  ServerEvent event_;
};

TEST_F(EventWatchTest, ReportsEventsWithCauseAndRemedyWithoutAToken) {
  operator_api_.operator_token.clear();
  start();
  EventWatch watch(options());
  EXPECT_FALSE(watch.next(event_, kAtOnce));
  begin_lost();
  expect(watch, "lost");
  EXPECT_THAT(event_,
              testing::FieldsAre(1u, 1'700'000'000'123, EventSeverity::kError, "drone", "lost",
                                 "lost, sees no tags", "Look at the camera.", false));
  ASSERT_EQ(watch.standing().size(), 1u);
  EXPECT_EQ(watch.standing()[0].kind, "lost");
  board_->end("drone", "lost", "back");
  ASSERT_TRUE(watch.next(event_, kTimeout));
  EXPECT_TRUE(event_.over);
  EXPECT_TRUE(watch.standing().empty());
}

TEST_F(EventWatchTest, StartsWithTheHistoryOrWithNewEvents) {
  report("started");
  begin_lost();
  start();
  EventWatch all(options());
  expect(all, "started");
  expect(all, "lost");
  EventWatch without_history(options(false));
  ASSERT_TRUE(wait_until([&] {
    EXPECT_FALSE(without_history.next(event_, kAtOnce));
    return without_history.standing().size() == 1;
  })) << without_history.problem();
  report("stored");
  expect(without_history, "stored");
}

TEST_F(EventWatchTest, LosesNothingWhenTheServerRestarts) {
  start();
  const auto port = server_->port();
  EventWatch watch(options());
  report("one");
  expect(watch, "one");
  report("two");
  expect(watch, "two");
  server_.reset();
  ASSERT_TRUE(wait_until([&] {
    EXPECT_FALSE(watch.next(event_, kAtOnce));
    return !watch.problem().empty();
  }));
  EXPECT_TRUE(watch.standing().empty()) << "they are not known";
  board_.emplace([] { return std::int64_t{0}; });  // numbers start again
  report("three");
  start(port);
  expect(watch, "three");
  EXPECT_TRUE(watch.problem().empty());
}

TEST_F(EventWatchTest, ManyWatchersLeaveRoomForOperators) {
  start();
  std::vector<std::unique_ptr<EventWatch>> watchers;
  for (int i = 0; i < 4; ++i) {
    watchers.push_back(std::make_unique<EventWatch>(options()));
    report("n");
    expect(*watchers.back(), "n");
  }
  ControlOptions control;
  control.port = server_->port();
  control.token = operator_api_.operator_token;
  control.timeout = kTimeout;
  ControlState state;
  const auto outcome = Control(control).list(state);
  EXPECT_TRUE(outcome) << outcome.problem;
}

TEST_F(EventWatchTest, ReportsThatThereIsNoServer) {
  start();
  const EventOptions nowhere = options();
  server_.reset();
  EventWatch watch(nowhere);
  EXPECT_FALSE(watch.next(event_, kAtOnce));
  EXPECT_THAT(watch.problem(), testing::HasSubstr(std::to_string(nowhere.port)));
}

}  // namespace
}  // namespace fiducap
