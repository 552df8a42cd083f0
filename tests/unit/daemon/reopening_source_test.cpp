#include "daemon/bodies/body_setup.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <stdexcept>

#include "support/fake_clock.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Not;

/// Gives a number of readings, one a second, then is unplugged, throws, or ends.
class Device final : public SensorSource {
 public:
  enum class End { kUnplugged, kThrows, kOver };
  Device(FakeClock& clock, int readings, End end) : clock_(clock), left_(readings), end_(end) {}
  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    if (left_ > 0) clock_.advance(1s);
    if (left_-- > 0) return ImuSample{};
    if (end_ == End::kThrows) throw std::runtime_error("driver bug");
    if (end_ == End::kOver) return std::nullopt;
    return fail(ErrorCode::kClosed, "gives no more images");
  }

 private:
  FakeClock& clock_;
  int left_;
  End end_;
};

class ReopeningSourceTest : public testing::Test {
 protected:
  using Opened = Expected<std::unique_ptr<SensorSource>>;
  Opened device(int readings, Device::End end) {
    return std::make_unique<Device>(clock_, readings, end);
  }
  void build(Opened first) {
    source_ = std::make_unique<ReopeningSource>(
        std::move(first),
        [this]() -> Opened {
          opened_at_.push_back(clock_.now() - Instant{});
          if (next_.empty()) return fail(ErrorCode::kNotFound, "no such device");
          Opened one = std::move(next_.front());
          next_.pop_front();
          return one;
        },
        ReopeningSource::Listener{[this](const Error& why) { said_.push_back(why.what); },
                                  [this] { said_.push_back("back"); }},
        clock_);
  }
  bool gives_a_sample() {
    const auto sample = source_->next(stop_.get_token());
    return sample && sample->has_value();
  }
  bool gives_samples(int count) {
    while (count > 0 && gives_a_sample()) --count;
    return count == 0;
  }

  FakeClock clock_;
  std::deque<Opened> next_;
  std::vector<Duration> opened_at_;
  std::vector<std::string> said_;
  std::stop_source stop_;
  std::unique_ptr<ReopeningSource> source_;
};

TEST_F(ReopeningSourceTest, ADeviceThatWasUnpluggedComesBackByItself) {
  next_.push_back(device(5, Device::End::kUnplugged));
  build(device(1, Device::End::kUnplugged));
  EXPECT_TRUE(gives_a_sample());
  EXPECT_THAT(said_, IsEmpty());
  EXPECT_TRUE(gives_a_sample()) << "of the device that was plugged in again";
  EXPECT_THAT(said_, ElementsAre("gives no more images")) << "one sample proves little";
  EXPECT_TRUE(gives_samples(4));
  EXPECT_THAT(said_, ElementsAre("gives no more images", "back"));
  EXPECT_THAT(opened_at_, ElementsAre(Duration(1250ms)));
}

TEST_F(ReopeningSourceTest, ADriverThatIsNotUpYetIsWaitedFor) {
  next_.push_back(fail(ErrorCode::kNotFound, "no such device"));
  next_.push_back(fail(ErrorCode::kUnavailable, "is busy"));
  next_.push_back(device(4, Device::End::kOver));
  build(fail(ErrorCode::kNotFound, "no such device"));
  EXPECT_TRUE(gives_samples(4));
  EXPECT_THAT(said_, ElementsAre("no such device", "is busy", "back"))
      << "each reason once, however often it is tried";
}

TEST_F(ReopeningSourceTest, ADeviceThatGivesOneSampleAndFailsIsNotBackAndItsPausesGrow) {
  for (int i = 0; i < 12; ++i) next_.push_back(device(1, Device::End::kUnplugged));
  build(device(1, Device::End::kUnplugged));
  EXPECT_TRUE(gives_samples(13));
  EXPECT_THAT(said_, Not(Contains("back")));
  ASSERT_EQ(opened_at_.size(), 12U);
  EXPECT_EQ(opened_at_[1] - opened_at_[0], 1500ms) << "a sample for a second, a pause of 500 ms";
  EXPECT_EQ(opened_at_[11] - opened_at_[10], 31s);
}

TEST_F(ReopeningSourceTest, EachLossIsToldForTheBodyIsLostEachTime) {
  next_.push_back(device(1, Device::End::kUnplugged));
  next_.push_back(device(1, Device::End::kOver));
  build(device(1, Device::End::kUnplugged));
  EXPECT_TRUE(gives_samples(3));
  EXPECT_THAT(said_, ElementsAre("gives no more images", "gives no more images"));
}

TEST_F(ReopeningSourceTest, PausesGrowToHalfAMinuteAndAreShortAgainAfterAMinuteOfSamples) {
  for (int i = 0; i < 10; ++i) next_.push_back(fail(ErrorCode::kNotFound, "no such device"));
  next_.push_back(device(61, Device::End::kUnplugged));
  next_.push_back(device(1, Device::End::kOver));
  build(device(0, Device::End::kUnplugged));
  EXPECT_TRUE(gives_samples(61));
  ASSERT_EQ(opened_at_.size(), 11U);
  EXPECT_EQ(opened_at_[1] - opened_at_[0], 500ms);
  EXPECT_EQ(opened_at_[10] - opened_at_[9], 30s);
  EXPECT_TRUE(gives_a_sample());
  EXPECT_EQ(opened_at_[11] - opened_at_[10], 61s + 250ms);
}

TEST_F(ReopeningSourceTest, AnExceptionOfADriverIsALossLikeAnyOther) {
  next_.push_back(device(4, Device::End::kOver));
  build(device(1, Device::End::kThrows));
  EXPECT_TRUE(gives_samples(5));
  EXPECT_THAT(said_, ElementsAre("driver bug", "back"));
}

TEST_F(ReopeningSourceTest, TheEndOfASourceIsTheEnd) {
  build(device(1, Device::End::kOver));
  EXPECT_TRUE(gives_a_sample());
  EXPECT_FALSE(gives_a_sample());
  EXPECT_THAT(opened_at_, IsEmpty());
}

TEST_F(ReopeningSourceTest, AStopEndsTheWaiting) {
  build(fail(ErrorCode::kNotFound, "no such device"));
  stop_.request_stop();
  EXPECT_FALSE(gives_a_sample());
}

}  // namespace
}  // namespace fiducap
