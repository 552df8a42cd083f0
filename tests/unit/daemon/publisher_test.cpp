#include "daemon/publisher.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/fake_clock.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;

constexpr Instant at_ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

/// A publisher at 100 Hz whose frames are kept; it is stopped from inside, by the receiver.
class PublisherTest : public testing::Test {
 protected:
  /// @param delay_ms  how long the receiver takes, per frame
  void publish(std::vector<int> delay_ms) {
    Publisher publisher(100, scene_, map_, clock_, [&](std::shared_ptr<const SceneFrame> frame) {
      at_.push_back(frame->at);
      numbers_.push_back(frame->number);
      rate_hz_ = frame->rate_hz;
      clock_.advance(std::chrono::milliseconds(delay_ms[at_.size() - 1]));
      if (at_.size() == delay_ms.size()) stop_.request_stop();
    });
    publisher.run(stop_.get_token());
    missed_ = publisher.missed();
    published_ = publisher.frames();
  }

  FakeClock clock_{at_ms(1000)};
  Scene scene_{{{{1, "robot"}, Pose{}, BodyLimits{}, BodySensors{}, EstimatorConfig{}, {}}}};
  MapBuilder map_{MapConfig{}, TagMap{}};
  std::stop_source stop_;
  std::vector<Instant> at_;
  std::vector<std::uint64_t> numbers_;
  double rate_hz_{};
  std::uint64_t missed_{};
  std::uint64_t published_{};
};

TEST_F(PublisherTest, TicksAtItsRate) {
  publish({0, 0, 0, 0});
  EXPECT_THAT(at_, ElementsAre(at_ms(1000), at_ms(1010), at_ms(1020), at_ms(1030)));
  EXPECT_EQ(missed_, 0u);
  EXPECT_EQ(rate_hz_, 100);
}

TEST_F(PublisherTest, ALateTickDoesNotMoveTheNextOne) {
  publish({0, 7, 0, 0});
  EXPECT_THAT(at_, ElementsAre(at_ms(1000), at_ms(1010), at_ms(1020), at_ms(1030)));
}

TEST_F(PublisherTest, LeavesMissedTicksOutAndKeepsItsGrid) {
  publish({0, 25, 0});
  EXPECT_THAT(at_, ElementsAre(at_ms(1000), at_ms(1010), at_ms(1040)));
  EXPECT_EQ(missed_, 2u);
}

TEST_F(PublisherTest, NumbersItsFramesWithoutGaps) {
  publish({0, 25, 0});
  EXPECT_THAT(numbers_, ElementsAre(1u, 2u, 3u));
  EXPECT_EQ(published_, 3u);
}

}  // namespace
}  // namespace fiducap
