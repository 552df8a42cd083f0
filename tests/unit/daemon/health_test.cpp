#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <new>

#include "daemon/watch/health_watch.hpp"
#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

/// A robot whose images come ten times a second and are looked at twice a second.
class BodyHealthTest : public testing::Test {
 protected:
  /// @param each  done before each look
  template <typename Each>
  void pass(Duration d, Each each) {
    for (const Instant end = now_ + d; now_ < end; now_ += 500ms) {
      each();
      health_.look(&pose_, now_);
    }
  }
  void healthy() {
    pulse_.image_came_ns = to_ns(now_);
    pulse_.images += 5;
    pulse_.lateness_ns = std::chrono::nanoseconds(20ms).count();
    pulse_.on_the_way_ns = std::chrono::nanoseconds(8ms).count();
    pose_.state = BodyState::kTracking;
  }
  void pass(Duration d) {
    pass(d, [this] { healthy(); });
  }
  std::vector<std::string> told() {
    std::vector<std::string> all;
    for (const Event& event : events_.after(0))
      all.push_back((event.over ? "over: " : "") + event.kind);
    return all;
  }
  std::string text() { return events_.after(0).empty() ? "" : events_.after(0).back().sentence(); }

  Instant now_{instant_from_ns(1'000'000'000)};
  EventBoard events_{[this] { return to_ns(now_); }};
  BodyPulse pulse_;
  BodyPose pose_;
  BodyHealth health_{"drone", 1, pulse_, events_};
};

TEST_F(BodyHealthTest, SaysNothingOfARobotThatIsWell) {
  pass(60s);
  EXPECT_THAT(told(), IsEmpty());
}

TEST_F(BodyHealthTest, SaysThatACameraIsSilentAndThatItIsBack) {
  pass(5s);
  pass(4s, [] {});
  EXPECT_THAT(told(), ElementsAre("silent"));
  EXPECT_THAT(text(), HasSubstr("drone: no more images from its camera. Check its"));
  pass(5s);
  EXPECT_THAT(told(), ElementsAre("silent", "over: silent"));
}

TEST_F(BodyHealthTest, OfSeveralCamerasTheSilentOneIsNamed) {
  BodyHealth health("drone", 2, pulse_, events_);
  const auto pass_with = [&](Duration d, bool second) {
    for (const Instant end = now_ + d; now_ < end; now_ += 500ms) {
      healthy();
      pulse_.camera_came_ns[0] = to_ns(now_);
      if (second) pulse_.camera_came_ns[1] = to_ns(now_);
      health.look(&pose_, now_);
    }
  };
  pass_with(5s, true);
  EXPECT_THAT(told(), IsEmpty());
  pass_with(4s, false);
  EXPECT_THAT(told(), ElementsAre("silent_1"));
  EXPECT_THAT(text(), HasSubstr("drone: no more images from its camera 1"));
  pass_with(5s, true);
  EXPECT_THAT(told(), ElementsAre("silent_1", "over: silent_1"));
}

TEST_F(BodyHealthTest, ACameraThatNeverGaveAnImageIsSilentToo) {
  pose_.state = BodyState::kSearching;
  pass(6s, [] {});
  EXPECT_THAT(text(), HasSubstr("no image so far"));
}

TEST_F(BodyHealthTest, ASourceThatHasEndedIsNotSilent) {
  pass(5s);
  pulse_.ended = true;
  pass(10s, [] {});
  EXPECT_THAT(told(), IsEmpty());
}

TEST_F(BodyHealthTest, LateImagesAreTheSourcesFaultWhenTheyWereLateOnArrival) {
  pass(5s, [this] {
    healthy();
    pulse_.lateness_ns = std::chrono::nanoseconds(400ms).count();
    pulse_.on_the_way_ns = std::chrono::nanoseconds(380ms).count();
  });
  EXPECT_THAT(told(), ElementsAre("source_late"));
  EXPECT_THAT(text(), HasSubstr("380 ms old when they arrive"));
  pass(5s);
  EXPECT_THAT(told(), ElementsAre("source_late", "over: source_late"));
}

TEST_F(BodyHealthTest, OtherwiseTheyAreOverload) {
  pass(5s, [this] {
    healthy();
    pulse_.lateness_ns = std::chrono::nanoseconds(400ms).count();
  });
  EXPECT_THAT(told(), ElementsAre("overload"));
  EXPECT_THAT(text(), HasSubstr("does not keep up: 0 % of its images are left out, poses are 400"));
}

TEST_F(BodyHealthTest, ImagesLeftOutAreOverloadToo) {
  pass(10s, [this] {
    healthy();
    pulse_.skipped += 3;
  });
  EXPECT_THAT(told(), ElementsAre("overload"));
  EXPECT_THAT(events_.standing().front().text, HasSubstr("60 % of its images"));
}

TEST_F(BodyHealthTest, ASingleLateImageIsNotWorthAWord) {
  int looks = 0;
  pass(60s, [&] {
    healthy();
    if (++looks % 4 == 0) pulse_.lateness_ns = std::chrono::nanoseconds(400ms).count();
  });
  EXPECT_THAT(told(), IsEmpty());
}

TEST_F(BodyHealthTest, APoseThatIsCarriedForLongIsToldAndAgainWhenItIsLost) {
  pass(5s);
  const auto untracked = [this](BodyState state) {
    return [this, state] {
      healthy();
      pose_.state = state;
    };
  };
  pass(1s, untracked(BodyState::kCoasting));
  EXPECT_THAT(told(), IsEmpty());
  pass(3s, untracked(BodyState::kCoasting));
  pass(3s, untracked(BodyState::kLost));
  pass(3s);
  EXPECT_THAT(told(), ElementsAre("tracking", "tracking", "over: tracking"));
  EXPECT_EQ(events_.after(0)[1].severity, Severity::kError);
  EXPECT_EQ(text(), "drone: is tracked again");
}

TEST_F(BodyHealthTest, WhatEndsBecauseNothingComesAnyMoreSaysSo) {
  const auto late_and_too_many = [this] {
    healthy();
    pulse_.lateness_ns = std::chrono::nanoseconds(400ms).count();
    pulse_.on_the_way_ns = std::chrono::nanoseconds(380ms).count();
    pulse_.skipped += 3;
  };
  pass(10s, late_and_too_many);
  EXPECT_THAT(told(), UnorderedElementsAre("source_late", "overload"));
  pass(5s, [] {});
  EXPECT_THAT(told(), UnorderedElementsAre("source_late", "overload", "silent", "over: source_late",
                                           "over: overload"));
  for (const Event& event : events_.after(2)) {
    if (event.over) {
      EXPECT_EQ(event.text, "no images come any more");
    }
  }
  pulse_.ended = true;
  pass(1s, [] {});
  EXPECT_EQ(text(), "drone: its source has ended");
}

TEST_F(BodyHealthTest, NeverMoreThanAllImagesAreLeftOut) {
  pass(5s);
  pass(3s, [this] {
    healthy();
    pulse_.skipped += 9;  // that waited from before
  });
  EXPECT_THAT(events_.standing().at(0).text, HasSubstr(" 100 % of its images"));
}

TEST_F(BodyHealthTest, ABodyThatIsStreamedNoMoreIsNoAlarm) {
  pass(5s);
  pass(3s, [this] {
    healthy();
    pose_.state = BodyState::kLost;
  });
  EXPECT_THAT(told(), ElementsAre("tracking"));
  health_.look(nullptr, now_);
  EXPECT_EQ(text(), "drone: is not streamed any more");
  EXPECT_THAT(events_.standing(), IsEmpty());
}

TEST_F(BodyHealthTest, ARobotThatDoesNotFindItsPlaceIsTold) {
  pass(12s, [this] {
    healthy();
    pose_.state = BodyState::kSearching;
  });
  EXPECT_THAT(text(), HasSubstr("has found no pose"));
}

TEST(FrameWatchdog, GivesUpAfterSoManyLooksInARowWithoutAFrame) {
  FrameWatchdog watchdog(3);
  std::uint64_t frames = 0;
  using Verdict = FrameWatchdog::Verdict;
  EXPECT_EQ(watchdog.look(++frames), Verdict::kFlows);
  EXPECT_EQ(watchdog.look(frames), Verdict::kStalled);
  EXPECT_EQ(watchdog.look(frames), Verdict::kStalled);
  EXPECT_EQ(watchdog.look(++frames), Verdict::kFlows);
  EXPECT_EQ(watchdog.look(frames), Verdict::kStalled);
  EXPECT_EQ(watchdog.look(frames), Verdict::kStalled);
  EXPECT_EQ(watchdog.look(frames), Verdict::kDead);
}

TEST(HealthWatch, GivesTheServerUpOnceWhenFramesReachNobody) {
  FakeClock clock(instant_from_ns(1'000'000'000));
  EventBoard events{[] { return std::int64_t{0}; }};
  Scene scene({});
  MapBuilder map(MapConfig{}, TagMap{});
  Publisher publisher(100, scene, map, clock, [](auto) {});
  int given_up = 0;
  HealthWatch watch(events, publisher, clock, [&] { ++given_up; });
  for (int i = 0; i < 3 * HealthWatch::kMissedLooks; ++i) {
    watch.delivered(nullptr);
    watch.look();
  }
  EXPECT_EQ(given_up, 0);
  for (int i = 0; i < 3 * HealthWatch::kMissedLooks; ++i) watch.look();
  EXPECT_EQ(given_up, 1);
  EXPECT_EQ(events.standing().back().kind, "stalled");
}

TEST(HealthWatch, GivesTheServerUpAlsoWhenThereIsNoMemoryToSaySo) {
  FakeClock clock(instant_from_ns(1'000'000'000));
  EventBoard events{[] { return std::int64_t{0}; }};
  Scene scene({});
  MapBuilder map(MapConfig{}, TagMap{});
  Publisher publisher(100, scene, map, clock, [](auto) {});
  int asked = 0;
  HealthWatch watch(events, publisher, clock, [&] {
    if (++asked == 1) throw std::bad_alloc();
  });
  for (int i = 0; i + 1 < HealthWatch::kMissedLooks; ++i) watch.look();
  AllocationFault::reach_this_thread();
  AllocationFault::arm(1);
  EXPECT_THROW(watch.look(), std::bad_alloc);
  EXPECT_TRUE(AllocationFault::disarm()) << "nothing was to be said";
  EXPECT_EQ(asked, 1);
  watch.look();
  EXPECT_EQ(asked, 2) << "who has not given up tries again";
  watch.look();
  EXPECT_EQ(asked, 2);
}

class MachineHealthTest : public testing::Test {
 protected:
  void look(const MachineState& state) { health_.look(state, now_ += 1s); }
  std::vector<std::string> standing() {
    std::vector<std::string> all;
    for (const Event& event : events_.standing()) all.push_back(event.subject + " " + event.kind);
    return all;
  }
  Instant now_{instant_from_ns(1'000'000'000)};
  EventBoard events_{[] { return std::int64_t{0}; }};
  MachineHealth health_{events_};
};

TEST_F(MachineHealthTest, SaysWhatIsWrongAsLongAsItIs) {
  MachineState state;
  look(state);
  EXPECT_THAT(standing(), IsEmpty());
  state.clock_synchronised = false;
  state.open_descriptors = 95;
  state.most_descriptors = 100;
  look(state);
  EXPECT_THAT(standing(), ElementsAre("clock unsynchronised", "server descriptors"));
  look({});
  EXPECT_THAT(standing(), IsEmpty());
}

TEST_F(MachineHealthTest, AClockThatMayNotBeAskedIsSaidOnceAndIsNoAlarm) {
  look({});
  look({});
  EXPECT_THAT(standing(), IsEmpty());
  const auto told = events_.after(0);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].kind, "unknown");
}

TEST_F(MachineHealthTest, FramesLeftOutAreOverload) {
  MachineState state;
  for (int i = 0; i < 5; ++i) {
    state.frames += 190;
    state.missed += 10;
    look(state);
  }
  EXPECT_THAT(standing(), ElementsAre("server overload"));
  for (int i = 0; i < 5; ++i) {
    state.frames += 200;
    look(state);
  }
  EXPECT_THAT(standing(), IsEmpty());
}

TEST(MachineState, IsReadFromThisMachine) {
  const MachineState state = read_machine_state();
  EXPECT_GT(state.open_descriptors, 3U);
  EXPECT_GT(state.most_descriptors, state.open_descriptors);
}

TEST(ServiceManager, IsToldThroughItsSocket) {
  const TemporaryFolder folder;
  const std::string path = folder.file("notify");
  const int socket = ::socket(AF_UNIX, SOCK_DGRAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  ASSERT_EQ(::bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
  EXPECT_TRUE(notify_service_manager("WATCHDOG=1"));
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_FALSE(notify_service_manager("WATCHDOG=1")) << "there is none";
  std::array<char, 64> said{};
  EXPECT_EQ(::recv(socket, said.data(), said.size(), MSG_DONTWAIT), 10);
  EXPECT_STREQ(said.data(), "WATCHDOG=1");
  ::close(socket);
}

}  // namespace
}  // namespace fiducap
