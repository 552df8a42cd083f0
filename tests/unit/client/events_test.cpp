// Events of the server's board, to the client over a real loopback socket.
#include "fiducap/events.hpp"
#include "fiducap/control.hpp"

#include <gtest/gtest.h>

#include <optional>

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
  static Event lost() {
    return {.severity = Severity::kError,
            .subject = "drone",
            .kind = "lost",
            .text = "lost, sees no tags",
            .remedy = "Look at the camera."};
  }

  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone"});
  std::optional<EventBoard> board_{[] { return std::int64_t{1'700'000'000'123'000'000}; }};
  FakeOperatorApi operator_api_;
  std::optional<TestServer> server_;
  ServerEvent event_;
};

TEST_F(EventWatchTest, TellsWhatHappensWithCauseAndRemedyWithoutAToken) {
  operator_api_.operator_token.clear();
  start();
  EventWatch watch(options());
  EXPECT_FALSE(watch.next(event_, kAtOnce));
  board_->begin(lost());
  ASSERT_TRUE(watch.next(event_, kPatience)) << watch.problem();
  EXPECT_EQ(event_.number, 1u);
  EXPECT_EQ(event_.at_utc_ms, 1'700'000'000'123);
  EXPECT_EQ(event_.severity, EventSeverity::kError);
  EXPECT_EQ(event_.subject, "drone");
  EXPECT_EQ(event_.kind, "lost");
  EXPECT_EQ(event_.text, "lost, sees no tags");
  EXPECT_EQ(event_.remedy, "Look at the camera.");
  EXPECT_FALSE(event_.over);
  ASSERT_EQ(watch.standing().size(), 1u);
  EXPECT_EQ(watch.standing()[0].kind, "lost");
  board_->end("drone", "lost", "back");
  ASSERT_TRUE(watch.next(event_, kPatience));
  EXPECT_TRUE(event_.over);
  EXPECT_TRUE(watch.standing().empty());
}

TEST_F(EventWatchTest, BeginsWithWhatTheServerStillKnowsUnlessOnlyNewsAreWanted) {
  board_->report({.subject = "server", .kind = "started", .text = "runs"});
  board_->begin(lost());
  start();
  EventWatch all(options());
  ASSERT_TRUE(all.next(event_, kPatience)) << all.problem();
  EXPECT_EQ(event_.kind, "started");
  ASSERT_TRUE(all.next(event_, kPatience));
  EXPECT_EQ(event_.kind, "lost");
  EventWatch news(options(false));
  ASSERT_TRUE(wait_until([&] {
    EXPECT_FALSE(news.next(event_, kAtOnce));
    return news.standing().size() == 1;
  })) << news.problem();
  board_->report({.subject = "map", .kind = "stored", .text = "stored"});
  ASSERT_TRUE(news.next(event_, kPatience)) << news.problem();
  EXPECT_EQ(event_.kind, "stored");
}

TEST_F(EventWatchTest, LosesNothingWhenTheServerRestarts) {
  start();
  const auto port = server_->port();
  EventWatch watch(options());
  board_->report({.subject = "server", .kind = "one", .text = "one"});
  ASSERT_TRUE(watch.next(event_, kPatience)) << watch.problem();
  board_->report({.subject = "server", .kind = "two", .text = "two"});
  ASSERT_TRUE(watch.next(event_, kPatience)) << watch.problem();
  server_.reset();
  ASSERT_TRUE(wait_until([&] {
    EXPECT_FALSE(watch.next(event_, kAtOnce));
    return !watch.problem().empty();
  }));
  EXPECT_TRUE(watch.standing().empty()) << "nobody knows";
  board_.emplace([] { return std::int64_t{0}; });  // numbers begin anew
  board_->report({.subject = "server", .kind = "three", .text = "three"});
  start(port);
  ASSERT_TRUE(watch.next(event_, kPatience)) << watch.problem();
  EXPECT_EQ(event_.kind, "three");
  EXPECT_TRUE(watch.problem().empty());
}

TEST_F(EventWatchTest, ManyWatchersLeaveThePlacesOfOperators) {
  start();
  std::vector<std::unique_ptr<EventWatch>> watchers;
  for (int i = 0; i < 4; ++i) {
    watchers.push_back(std::make_unique<EventWatch>(options()));
    board_->report({.subject = "server", .kind = "n", .text = std::to_string(i)});
    ASSERT_TRUE(watchers.back()->next(event_, kPatience)) << watchers.back()->problem();
  }
  ControlOptions control;
  control.port = server_->port();
  control.token = operator_api_.operator_token;
  control.timeout = kPatience;
  ControlState state;
  const auto outcome = Control(control).list(state);
  EXPECT_TRUE(outcome) << outcome.problem;
}

TEST_F(EventWatchTest, SaysWhyThereIsNothing) {
  start();
  EventOptions nowhere = options();
  server_.reset();
  EventWatch watch(nowhere);
  EXPECT_FALSE(watch.next(event_, kAtOnce));
  EXPECT_NE(watch.problem().find(std::to_string(nowhere.port)), std::string::npos);
}

}  // namespace
}  // namespace fiducap
