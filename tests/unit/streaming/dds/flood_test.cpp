// More participants than plausible: the server leaves the domain, which removes them, and joins
// again.
#include <gmock/gmock.h>

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <future>
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

/// Waits for threads of the middleware.
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
  /// Each is awaited, so that none is lost in a full socket buffer.
  void forge(const Participant& known_to, int count) {
    for (int i = 0; i < count; ++i) {
      const int seen = known_to.count().seen;
      forger_.send(announcement(++forged_, "127.0.0.1", forger_.port()), "127.0.0.1", kPort);
      ASSERT_TRUE(comes_true([&] { return known_to.count().seen > seen; })) << i;
    }
  }
  std::shared_ptr<Participant> join() {
    auto participant = membership_.join();
    EXPECT_TRUE(participant) << participant.error().text();
    return *participant;
  }
  /// A server of a drone, which then sees too many participants.
  void flood_server(const JoinDomain& join_domain) {
    auto server = serve(
        {.io = io_, .model = frame_->model, .clock = clock_, .join_dds = join_domain}, DdsConfig{});
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    forge(*join(), ParticipantCount::kMostPresent + 1);
    server_->publish(frame_);
  }
  /// Frames at intervals in which the server may join again.
  template <typename Condition>
  bool publish_until(Condition&& condition) {
    return comes_true([&] {
      clock_.advance(11s);
      server_->publish(frame_);
      return condition();
    });
  }
  void TearDown() override {
    if (server_) server_->stop();
  }

  EventBoard events_{[] { return std::int64_t{0}; }};
  Membership membership_{{.domain = kDomain, .peers = {}}, events_};
  Socket forger_{"127.0.0.1"};
  std::uint32_t forged_{0};
  boost::asio::io_context io_;
  FakeClock clock_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"drone"});
  std::unique_ptr<Streamer> server_;
};

TEST_F(DdsFlood, IsNotReportedForAFewParticipants) {
  const auto participant = join();
  forge(*participant, 3);
  EXPECT_EQ(participant->count().present, 4);
  EXPECT_FALSE(participant->is_to_be_left());
  EXPECT_EQ(join(), participant) << "the same for all";
}

TEST_F(DdsFlood, IsReportedOnceAndEndsByLeavingTheDomain) {
  auto participant = join();
  forge(*participant, ParticipantCount::kMostPresent + 8);
  EXPECT_TRUE(participant->is_to_be_left());
  EXPECT_THAT(events_.after(0), testing::SizeIs(1));
  EXPECT_THAT(events_.standing(), Contains(Field(&Event::text, HasSubstr("257 participants"))));
  EXPECT_FALSE(membership_.join()) << "the flooded one is still held";
  participant = nullptr;
  const auto again = join();
  EXPECT_EQ(again->count().seen, 1);
  EXPECT_THAT(events_.standing(), IsEmpty());
}

TEST_F(DdsFlood, ServerLeavesAndJoinsAgainAfterADelay) {
  flood_server([this] { return membership_.join(); });
  ASSERT_TRUE(comes_true([this] { return membership_.join().has_value(); })) << "it has left";
  server_->publish(frame_);
  EXPECT_EQ(membership_.join()->use_count(), 1) << "not at once";
  EXPECT_TRUE(publish_until([this] {
    const auto joined = membership_.join();
    return joined && joined->use_count() > 1;
  }));
}

TEST_F(DdsFlood, JoiningAgainDoesNotBlockPublish) {
  std::atomic<int> joins{0};
  std::atomic<int> joined{0};          // of those
  std::promise<void> names_are_found;  // a resolver that does not answer
  flood_server([&, found = names_are_found.get_future().share()] {
    if (++joins > 1) found.wait();
    auto membership = membership_.join();
    if (membership) ++joined;
    return membership;
  });
  EXPECT_TRUE(publish_until([&] { return joins == 2; }));
  for (int i = 0; i < 100; ++i) server_->publish(frame_);  // would wait for the resolver
  EXPECT_EQ(joins, 2);
  names_are_found.set_value();
  EXPECT_TRUE(publish_until([&] { return joined == 2; }));
  server_->stop();  // before the variables end
  server_.reset();
}

}  // namespace
}  // namespace fiducap::dds
