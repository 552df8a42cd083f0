// More participants than plausible: the server leaves the domain, which forgets them, and joins
// again.
#include <gmock/gmock.h>
#include <atomic>
#include <future>

#include <chrono>
#include <thread>

#include "forged_participant.hpp"
#include "middleware/participant.hpp"
#include "streaming/dds/dds.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::dds {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kDomain = 48;
constexpr int kPort = 7400 + 250 * kDomain + 10;
constexpr auto kTimeout = 10s;

/// Waits for something that the middleware's threads do.
template <typename Condition>
bool comes_true(Condition&& condition) {
  const auto end = std::chrono::steady_clock::now() + kTimeout;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::yield();
  }
  return true;
}

class DdsFlood : public testing::Test {
 protected:
  static NetworkConfig network() {
    NetworkConfig config;
    config.domain = kDomain;
    return config;
  }
  /// One after the other, each awaited: none is lost in a full socket buffer.
  void forge(const Participant& known_to, int count) {
    for (int i = 0; i < count; ++i) {
      const int seen = known_to.count().seen;
      forger_.send(announcement(++forged_, "127.0.0.1", forger_.port()), "127.0.0.1", kPort);
      ASSERT_TRUE(comes_true([&] { return known_to.count().seen > seen; })) << i;
    }
  }

  EventBoard events_{[] { return std::int64_t{0}; }};
  Membership membership_{network(), events_};
  Socket forger_{"127.0.0.1"};
  std::uint32_t forged_{0};
};

TEST_F(DdsFlood, AFewParticipantsAreNoFlood) {
  const auto participant = membership_.join();
  ASSERT_TRUE(participant) << participant.error().text();
  forge(**participant, 3);
  EXPECT_EQ((*participant)->count().present, 4);
  EXPECT_FALSE((*participant)->is_flooded());
  EXPECT_EQ(*membership_.join(), *participant) << "one for all who join";
}

TEST_F(DdsFlood, IsReportedOnceAndForgottenByLeavingTheDomain) {
  auto participant = membership_.join();
  ASSERT_TRUE(participant) << participant.error().text();
  forge(**participant, ParticipantCount::kMostPresent + 8);
  EXPECT_TRUE((*participant)->is_flooded());
  EXPECT_THAT(events_.after(0), testing::SizeIs(1));
  EXPECT_THAT(events_.standing(), Contains(Field(&Event::text, HasSubstr("257 participants"))));
  EXPECT_FALSE(membership_.join()) << "the flooded one is still held";
  *participant = nullptr;
  const auto again = membership_.join();
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ((*again)->count().seen, 1);
  EXPECT_THAT(events_.standing(), IsEmpty());
}

TEST_F(DdsFlood, TheServerLeavesAndComesBackAfterAWhile) {
  FakeClock clock;
  const auto frame = make_scene_frame({"drone"});
  auto server = start_dds_server([this] { return membership_.join(); }, {}, frame->model, clock);
  ASSERT_TRUE(server) << server.error().text();
  forge(**membership_.join(), ParticipantCount::kMostPresent + 1);
  (*server)->publish(frame);
  ASSERT_TRUE(comes_true([this] { return membership_.join().has_value(); })) << "has let go";
  (*server)->publish(frame);
  EXPECT_EQ(membership_.join()->use_count(), 1) << "not at once";
  ASSERT_TRUE(comes_true([&] {
    (*server)->publish(frame);
    clock.advance(11s);
    const auto joined = membership_.join();
    return joined && joined->use_count() > 1;
  }));
  (*server)->stop();
}

TEST_F(DdsFlood, RejoiningDoesNotBlockPublish) {
  FakeClock clock;
  const auto frame = make_scene_frame({"drone"});
  std::atomic<int> joins{0};
  std::atomic<int> joined{0};          // of those
  std::promise<void> names_are_found;  // a resolver that does not answer
  auto server = start_dds_server(
      [&, found = names_are_found.get_future().share()] {
        if (++joins > 1) found.wait();
        auto membership = membership_.join();
        if (membership) ++joined;
        return membership;
      },
      {}, frame->model, clock);
  ASSERT_TRUE(server) << server.error().text();
  forge(**membership_.join(), ParticipantCount::kMostPresent + 1);
  (*server)->publish(frame);
  ASSERT_TRUE(comes_true([&] {
    clock.advance(11s);
    (*server)->publish(frame);
    return joins == 2;
  }));
  for (int i = 0; i < 100; ++i) (*server)->publish(frame);  // would stand here for ever
  EXPECT_EQ(joins, 2);
  names_are_found.set_value();
  EXPECT_TRUE(comes_true([&] {
    clock.advance(11s);
    (*server)->publish(frame);
    return joined == 2;  // joining to find out would be in the way
  }));
  (*server)->stop();
}

}  // namespace
}  // namespace fiducap::dds
