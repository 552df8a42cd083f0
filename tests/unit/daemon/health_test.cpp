#include <gmock/gmock.h>
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

/// A robot with ten images per second, checked twice a second.
class BodyHealthTest : public testing::Test {
 protected:
  /// @param each  done before each look
  template <typename Each>
  void pass(Duration d, Each each) {
    for (const Instant end = now_ + d; now_ < end; now_ += 500ms) {
      each();
      health_.look(&pose_, waiting_share_, now_);
    }
  }
  void healthy() {
    pulse_.image_came_ns = to_ns(now_);
    pulse_.images += 5;
    set_late(20ms, 8ms);
    pose_.state = BodyState::kTracking;
  }
  /// @param on_arrival  age of the images when they arrive
  void set_late(std::chrono::nanoseconds late, std::chrono::nanoseconds on_arrival) {
    pulse_.lateness_ns = late.count();
    pulse_.on_the_way_ns = on_arrival.count();
  }
  void pass(Duration d) {
    pass(d, [this] { healthy(); });
  }
  void pass_in(Duration d, BodyState state) {
    pass(d, [this, state] {
      healthy();
      pose_.state = state;
    });
  }
  std::vector<std::string> kinds() {
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
  double waiting_share_{0};
  BodyHealth health_{"drone", 1, {"Check its cable"}, pulse_, events_};
};

TEST_F(BodyHealthTest, ReportsWhyNoTagIsFound) {
  for (int k = 0; k < 5; ++k)
    pulse_.unseen.note(std::make_shared<GrayImage>(), now_ + k * 1s, false);
  EXPECT_EQ(pulse_.unseen.take().size(), 5u);
  pulse_.unseen.answer("the images are mirrored");
  pass_in(12s, BodyState::kSearching);
  EXPECT_THAT(text(), HasSubstr("for 10 s. No tag is found: the images are mirrored"));
}

TEST_F(BodyHealthTest, ReportsASilentCameraUntilItIsBack) {
  pass(5s);
  pass(4s, [] {});
  EXPECT_THAT(kinds(), ElementsAre("silent"));
  EXPECT_THAT(text(), HasSubstr("drone: no more images from its camera. Check its"));
  pass(5s);
  EXPECT_THAT(kinds(), ElementsAre("silent", "over: silent"));
}

TEST_F(BodyHealthTest, NamesTheSilentCameraOfSeveral) {
  BodyHealth health("drone", 2, {"Check its cable"}, pulse_, events_);
  const auto pass_with = [&](Duration d, bool second) {
    pass(d, [&] {
      healthy();
      pulse_.camera_came_ns[0] = to_ns(now_);
      if (second) pulse_.camera_came_ns[1] = to_ns(now_);
      health.look(&pose_, 0, now_);
    });
  };
  pass_with(5s, true);
  EXPECT_THAT(kinds(), IsEmpty());
  pass_with(4s, false);
  EXPECT_THAT(kinds(), ElementsAre("silent_1"));
  EXPECT_THAT(text(), HasSubstr("drone: no more images from its camera 1"));
  pass_with(5s, true);
  EXPECT_THAT(kinds(), ElementsAre("silent_1", "over: silent_1"));
}

TEST_F(BodyHealthTest, BlamesABusyComputerForMissingImages) {
  waiting_share_ = 0.95;
  pass(5s);
  EXPECT_THAT(kinds(), IsEmpty());
  pass(4s, [] {});
  EXPECT_THAT(kinds(), ElementsAre("overload"));
  EXPECT_EQ(text(),
            "drone: this computer does not keep up: no images are read. End other programs, reduce "
            "the rate or size of images, or add cores");
  waiting_share_ = 0.2;
  pass(1s, [] {});
  EXPECT_THAT(kinds(), ElementsAre("overload", "silent", "over: overload"));
}

TEST_F(BodyHealthTest, ReportsACameraWithoutAnyImage) {
  pose_.state = BodyState::kSearching;
  pass(6s, [] {});
  EXPECT_THAT(text(), HasSubstr("no image so far"));
}

TEST_F(BodyHealthTest, DoesNotReportAnEndedSource) {
  pass(5s);
  pulse_.ended = true;
  pass(10s, [] {});
  EXPECT_THAT(kinds(), IsEmpty());
}

TEST_F(BodyHealthTest, ReportsImagesThatAreLateOnArrival) {
  pass(5s, [this] {
    healthy();
    set_late(400ms, 380ms);
  });
  EXPECT_THAT(kinds(), ElementsAre("source_late"));
  EXPECT_THAT(text(), HasSubstr("380 ms old when they arrive"));
  pass(5s);
  EXPECT_THAT(kinds(), ElementsAre("source_late", "over: source_late"));
}

TEST_F(BodyHealthTest, ReportsOtherLateImagesAsOverload) {
  pass(5s, [this] {
    healthy();
    set_late(400ms, 8ms);
  });
  EXPECT_THAT(kinds(), ElementsAre("overload"));
  EXPECT_THAT(text(), HasSubstr("does not keep up: 0 % of the images are left out, poses are 400"));
}

TEST_F(BodyHealthTest, ReportsSkippedImagesAsOverload) {
  pass(10s, [this] {
    healthy();
    pulse_.skipped += 3;
  });
  EXPECT_THAT(kinds(), ElementsAre("overload"));
  EXPECT_THAT(events_.standing().front().text, HasSubstr("60 % of the images"));
  pass(10s, [this] {
    healthy();
    pulse_.skipped += 9;  // older images among them
  });
  EXPECT_THAT(events_.standing().front().text, HasSubstr(" 100 % of the images"));
}

TEST_F(BodyHealthTest, IgnoresSingleLateImages) {
  int looks = 0;
  pass(60s, [&] {
    healthy();
    if (++looks % 4 == 0) set_late(400ms, 8ms);
  });
  EXPECT_THAT(kinds(), IsEmpty());
}

TEST_F(BodyHealthTest, TellsWhyABusyComputerFindsNoPose) {
  BodyHealth health("film", 1, {"", "Replay it"}, pulse_, events_);
  pose_.state = BodyState::kSearching;
  for (const Instant end = now_ + 12s; now_ < end; now_ += 500ms) {
    pulse_.image_came_ns = to_ns(now_);
    pulse_.images += 5;
    pulse_.skipped += 4;
    health.look(&pose_, 0, now_);
  }
  EXPECT_THAT(kinds(), ElementsAre("overload", "tracking"));
  EXPECT_EQ(
      text(),
      "film: has found no pose for 10 s: this computer uses too few of its images. Replay it");
}

TEST_F(BodyHealthTest, ReportsCoastingAndLoss) {
  pass(5s);
  pass_in(1s, BodyState::kCoasting);
  EXPECT_THAT(kinds(), IsEmpty());
  pass_in(3s, BodyState::kCoasting);
  pass_in(3s, BodyState::kLost);
  pass(3s);
  EXPECT_THAT(kinds(), ElementsAre("tracking", "tracking", "over: tracking"));
  EXPECT_EQ(events_.after(0)[1].severity, Severity::kError);
  EXPECT_EQ(text(), "drone: is tracked again");
}

TEST_F(BodyHealthTest, EndsConditionsWhenNoImagesCome) {
  const auto late_and_too_many = [this] {
    healthy();
    set_late(400ms, 380ms);
    pulse_.skipped += 3;
  };
  pass(10s, late_and_too_many);
  EXPECT_THAT(kinds(), UnorderedElementsAre("source_late", "overload"));
  pass(5s, [] {});
  EXPECT_THAT(kinds(), UnorderedElementsAre("source_late", "overload", "silent",
                                            "over: source_late", "over: overload"));
  for (const Event& event : events_.after(2))
    EXPECT_EQ(event.over, event.text == "no images come any more");
  pulse_.ended = true;
  pass(1s, [] {});
  EXPECT_EQ(text(), "drone: its source has ended");
}

TEST_F(BodyHealthTest, EndsConditionsOfABodyThatIsNotStreamed) {
  pass(5s);
  pass_in(3s, BodyState::kLost);
  EXPECT_THAT(kinds(), ElementsAre("tracking"));
  health_.look(nullptr, 0, now_);
  EXPECT_EQ(text(), "drone: is not streamed any more");
  EXPECT_THAT(events_.standing(), IsEmpty());
}

TEST_F(BodyHealthTest, ReportsARobotWithoutAPose) {
  pass_in(12s, BodyState::kSearching);
  EXPECT_THAT(text(), HasSubstr("has found no pose"));
}

TEST(FrameWatchdog, FiresAfterThreeLooksWithoutAFrame) {
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

class HealthWatchTest : public testing::Test {
 protected:
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  EventBoard events_{[] { return std::int64_t{0}; }};
  Scene scene_{std::vector<SceneBody>{}};
  MapBuilder map_{MapConfig{}, TagMap{}};
  Publisher publisher_{100, scene_, map_, clock_, [](auto) {}};
};

TEST_F(HealthWatchTest, StopsTheServerOnceWhenNoFrameIsDelivered) {
  int given_up = 0;
  HealthWatch watch(events_, publisher_, clock_, [&] { ++given_up; });
  for (int i = 0; i < 3 * HealthWatch::kMissedLooks; ++i) {
    watch.delivered(nullptr);
    watch.look();
  }
  EXPECT_EQ(given_up, 0);
  for (int i = 0; i < 3 * HealthWatch::kMissedLooks; ++i) watch.look();
  EXPECT_EQ(given_up, 1);
  EXPECT_EQ(events_.standing().back().kind, "stalled");
}

TEST_F(HealthWatchTest, StopsTheServerWithoutMemory) {
  int asked = 0;
  HealthWatch watch(events_, publisher_, clock_, [&] {
    if (++asked == 1) throw std::bad_alloc();
  });
  for (int i = 0; i + 1 < HealthWatch::kMissedLooks; ++i) watch.look();
  AllocationFault::reach_this_thread();
  AllocationFault::arm(1);
  EXPECT_THROW(watch.look(), std::bad_alloc);
  EXPECT_TRUE(AllocationFault::disarm()) << "no allocation failed";
  EXPECT_EQ(asked, 1);
  watch.look();
  EXPECT_EQ(asked, 2) << "tried again";
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

TEST_F(MachineHealthTest, ReportsConditionsWhileTheyHold) {
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

TEST_F(MachineHealthTest, ReportsAnUnreadableClockOnce) {
  look({});
  look({});
  EXPECT_THAT(standing(), IsEmpty());
  const auto events = events_.after(0);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, "unknown");
}

TEST_F(MachineHealthTest, ReportsMissedFramesAsOverload) {
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

TEST_F(MachineHealthTest, ReportsFramesThatWereReplacedBeforeTheyWereSentAsOverload) {
  MachineState state;
  for (int i = 0; i < 5; ++i) {
    state.frames += 200;
    state.replaced += 40;
    look(state);
  }
  EXPECT_THAT(standing(), ElementsAre("server overload"));
  EXPECT_THAT(events_.standing().back().text, testing::HasSubstr("left out (20 %)"));
  --state.replaced;  // the one that was on its way has been sent
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

TEST(ServiceManager, IsNotifiedThroughItsSocket) {
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
