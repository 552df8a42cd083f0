#include "capture/sample_merger.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <string>

#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using std::chrono::milliseconds;

Instant ms(double t) { return instant_from_ns(static_cast<std::int64_t>(t * 1e6)); }
ImuSample imu(double t_ms) { return {ms(t_ms), {0.1, 0.2, 0.3}, {0, 0, 9.81}}; }
CornerFrame image(double t_ms, int camera = 0) { return {camera, ms(t_ms), {}}; }

std::string name_of(const SensorSample& sample) {
  const std::string t = std::to_string(to_ns(time_of(sample)) / 1'000'000);
  if (std::holds_alternative<ImuSample>(sample)) return "imu" + t;
  return "cam" + std::to_string(std::get<CornerFrame>(sample).camera) + "@" + t;
}

class SampleMergerTest : public testing::Test {
 protected:
  void make(bool has_imu, std::size_t max_images = 8, std::size_t max_imu = 64) {
    merger_.emplace(MergerConfig{.has_imu = has_imu, .max_images = max_images, .max_imu = max_imu});
  }
  void push(const SensorSample& sample) { EXPECT_TRUE(merger_->push(sample)); }
  std::vector<std::string> drain() {
    std::vector<std::string> names;
    while (const auto sample = merger_->pop()) names.push_back(name_of(*sample));
    return names;
  }
  using Names = std::vector<std::string>;

  std::optional<SampleMerger> merger_{MergerConfig{}};
};

TEST_F(SampleMergerTest, AnImageComesRightAfterTheFirstImuSampleAtOrAfterIt) {
  for (const double t : {0, 5, 10, 15, 20}) push(imu(t));
  push(image(7));
  EXPECT_EQ(drain(), (Names{"imu0", "imu5", "imu10", "cam0@7"}));
}

TEST_F(SampleMergerTest, AnImageAtTheTimeOfAnImuSampleComesRightAfterThatOne) {
  for (const double t : {0, 5, 10, 15}) push(imu(t));
  push(image(10));
  EXPECT_EQ(drain(), (Names{"imu0", "imu5", "imu10", "cam0@10", "imu15"}));
}

TEST_F(SampleMergerTest, AShiftOfTheClockMovesImagesAndIsNotedInThem) {
  merger_->set_clock_shift(0, milliseconds(6));
  for (const double t : {0, 5, 10, 15}) push(imu(t));
  push(image(7));
  std::vector<std::string> names;
  while (const auto sample = merger_->pop()) {
    names.push_back(name_of(*sample));
    if (std::holds_alternative<CornerFrame>(*sample)) {
      EXPECT_EQ(clock_shift_of(*sample), milliseconds(6));
    }
  }
  EXPECT_EQ(names, (Names{"imu0", "imu5", "imu10", "imu15", "cam0@13"}));
}

TEST_F(SampleMergerTest, AShiftNeverMovesAWaitingImageBeforeWhatWasGivenOut) {
  make(false);
  push(image(0, 1));
  push(image(10, 0));
  push(image(12, 1));
  EXPECT_EQ(drain(), (Names{"cam1@0", "cam0@10"})) << "cam1@12 waits for camera 0";
  merger_->set_clock_shift(1, milliseconds(-5));
  push(image(20, 0));
  EXPECT_EQ(drain(), (Names{})) << "cam1@7 would be older than cam0@10";
  EXPECT_EQ(merger_->statistics().late_dropped, 1u);
  push(image(30, 1));
  EXPECT_EQ(drain(), (Names{"cam0@20"}));
}

TEST_F(SampleMergerTest, AnImageWaitsForTheImuSampleThatClosesItsInterval) {
  push(imu(0));
  push(image(7));
  push(imu(5));
  EXPECT_EQ(drain(), (Names{"imu0", "imu5"}));
  push(imu(10));
  EXPECT_EQ(drain(), (Names{"imu10", "cam0@7"}));
}

TEST_F(SampleMergerTest, TwoImagesWithinOneImuIntervalKeepTheirOrder) {
  push(imu(0));
  push(image(7, 0));
  push(image(6, 1));
  push(imu(10));
  EXPECT_EQ(drain(), (Names{"imu0", "imu10", "cam1@6"}))
      << "camera 1 may still deliver something at 6.5";
  push(image(57, 1));
  EXPECT_EQ(drain(), (Names{"cam0@7"}));
}

TEST_F(SampleMergerTest, EqualImagesOfSeveralCamerasComeByCameraIndex) {
  push(imu(0));
  push(image(3, 0));
  push(image(3, 1));
  push(imu(5));
  drain();
  push(image(53, 1));
  push(image(53, 0));
  push(imu(60));
  push(imu(65));
  EXPECT_EQ(drain(), (Names{"imu60", "cam0@53", "cam1@53"}));
}

TEST_F(SampleMergerTest, ImuSamplesAreHeldUntilNoEarlierImageCanBeOnItsWay) {
  push(image(0));
  for (double t = 0; t <= 100; t += 5) push(imu(t));
  EXPECT_EQ(drain(), (Names{"imu0", "cam0@0", "imu5"}));
  push(image(50));  // 50 ms late, and yet in place
  const Names names = drain();
  ASSERT_EQ(names.size(), 11u);
  EXPECT_EQ(names[8], "imu50");
  EXPECT_EQ(names[9], "cam0@50");
}

TEST_F(SampleMergerTest, ImuSamplesWithoutAnyCameraLagByTheWindowOnly) {
  for (double t = 0; t <= 200; t += 10) push(imu(t));
  EXPECT_EQ(drain(), (Names{"imu0"}));
  for (double t = 210; t <= 300; t += 10) push(imu(t));
  EXPECT_EQ(drain().back(), "imu50");
}

TEST_F(SampleMergerTest, AnImageOlderThanWhatIsOutIsDroppedAndCounted) {
  for (double t = 0; t <= 400; t += 10) push(imu(t));
  drain();
  push(image(50));
  EXPECT_EQ(merger_->statistics().late_dropped, 1u);
  push(image(395));
  const Names names = drain();
  EXPECT_EQ(names.back(), "cam0@395");
}

TEST_F(SampleMergerTest, AnImageWhoseImuSamplesNeverComeIsReleasedAfterTheWindow) {
  push(imu(0));
  push(image(10));
  push(image(60));
  push(image(250));
  EXPECT_EQ(drain(), (Names{"imu0"}));
  push(image(270));
  EXPECT_EQ(drain(), (Names{"cam0@10"}));
  EXPECT_EQ(merger_->statistics().imu_waits_expired, 1u);
  push(imu(5));  // too late: the image at 10 is out
  EXPECT_EQ(merger_->statistics().late_dropped, 1u);
}

TEST_F(SampleMergerTest, WithAFullQueueTheOldestImageGoesAndNoImuSample) {
  make(true, 2);
  push(imu(0));
  for (const double t : {1, 2, 3, 4}) push(image(t));
  push(imu(5));
  EXPECT_EQ(drain(), (Names{"imu0", "imu5", "cam0@3", "cam0@4"}));
  EXPECT_EQ(merger_->statistics().images_dropped, 2u);
}

TEST_F(SampleMergerTest, AFullImuQueueMeansThatTheConsumerIsDead) {
  make(true, 2, 3);
  for (const double t : {0, 1, 2}) push(imu(t));
  EXPECT_FALSE(merger_->push(imu(3)));
  EXPECT_EQ(drain(), (Names{"imu0"}));
  EXPECT_TRUE(merger_->push(imu(3)))
      << "there is room again, and the refused sample was not taken as seen";
}

TEST_F(SampleMergerTest, TimeOfOneSensorThatDoesNotIncreaseIsDroppedAndCounted) {
  push(imu(10));
  push(imu(10));
  push(imu(5));
  push(image(20, 0));
  push(image(20, 0));
  push(image(15, 0));
  push(image(15, 1));  // another camera has its own time
  EXPECT_EQ(merger_->statistics().backwards_dropped, 4u);
  merger_->finish();
  EXPECT_EQ(drain(), (Names{"imu10", "cam1@15", "cam0@20"}));
}

TEST_F(SampleMergerTest, NumbersThatAreNoNumbersAreDroppedAndCounted) {
  ImuSample bad = imu(0);
  bad.w_WB_B.y() = std::numeric_limits<double>::quiet_NaN();
  push(bad);
  bad = imu(0);
  bad.f_B.z() = std::numeric_limits<double>::infinity();
  push(bad);
  CornerFrame frame = image(1);
  frame.tags.push_back({});
  frame.tags[0].corners_px.fill({1, 1});
  frame.tags[0].corners_px[3].x() = std::numeric_limits<double>::quiet_NaN();
  push(frame);
  push(CameraFrame{0, ms(1), nullptr});
  push(CameraFrame{0, ms(1), std::make_shared<GrayImage>()});
  push(image(1, -1));
  push(image(1, 1000));
  merger_->finish();
  EXPECT_TRUE(drain().empty());
  EXPECT_EQ(merger_->statistics().bad_dropped, 7u);
}

TEST_F(SampleMergerTest, WithoutImuASingleCameraWaitsForItsSecondImageOnly) {
  make(false);
  push(imu(1));  // unused
  push(image(5));
  push(image(55));
  EXPECT_EQ(drain(), (Names{"cam0@5", "cam0@55"}));
  push(image(105));
  EXPECT_EQ(drain(), (Names{"cam0@105"}));
}

TEST_F(SampleMergerTest, AStampFromTheFutureDoesNotSilenceTheRest) {
  std::size_t out = 0;
  push(imu(1e9));
  for (double t = 0; t <= 400; t += 10) {
    push(imu(t == 200 ? 2e9 : t));
    push(image(t == 100 ? 3e9 : t));
    out += drain().size();
  }
  merger_->finish();
  EXPECT_EQ(out + drain().size(), 40u + 40u);
  EXPECT_EQ(merger_->statistics().far_dropped, 3u);
  EXPECT_EQ(merger_->statistics().backwards_dropped + merger_->statistics().late_dropped, 0u);
}

TEST_F(SampleMergerTest, WithoutImuImagesOfSeveralCamerasComeByTime) {
  make(false);
  push(image(0, 0));
  push(image(0, 1));
  drain();
  push(image(60, 1));
  EXPECT_TRUE(drain().empty());
  push(image(50, 0));
  EXPECT_EQ(drain(), (Names{"cam0@50"}));
  push(image(100, 0));
  EXPECT_EQ(drain(), (Names{"cam1@60"}));
}

TEST_F(SampleMergerTest, ACameraThatDiedIsNotWaitedForLongerThanTheWindow) {
  make(false);
  push(image(0, 0));
  push(image(0, 1));
  drain();
  for (double t = 50; t <= 250; t += 50) push(image(t, 0));
  EXPECT_TRUE(drain().empty());
  push(image(300, 0));
  EXPECT_EQ(drain().size(), 6u);
  push(image(350, 0));
  EXPECT_EQ(drain(), (Names{"cam0@350"}));
}

TEST_F(SampleMergerTest, AfterFinishTheRestComesWithoutWaiting) {
  push(imu(0));
  push(imu(5));
  push(imu(10));
  push(image(7));
  push(image(12));
  merger_->finish();
  EXPECT_EQ(drain(), (Names{"imu0", "imu5", "imu10", "cam0@7", "cam0@12"}));
  EXPECT_EQ(merger_->statistics().imu_waits_expired, 1u)
      << "nothing closes the interval of the last image";
}

struct Arrival {
  double at_ms;
  SensorSample sample;
};

// Everything a body with 200 Hz IMU and two cameras measures in `seconds`, each sample with a delay
// of its own; within one sensor the order of arrival is kept.
std::vector<Arrival> random_arrivals(std::mt19937& random, double seconds) {
  std::uniform_real_distribution<double> imu_delay(0, 8);
  std::uniform_real_distribution<double> image_delay(5, 90);
  std::vector<Arrival> arrivals;
  const auto add = [&](double end, double period, double phase, auto& delay, auto make_sample) {
    double arrived = 0;
    for (double t = phase; t < end; t += period) {
      arrived = std::max(arrived, t + delay(random));
      arrivals.push_back({arrived, make_sample(t)});
    }
  };
  const double end = seconds * 1000;
  add(end + 10, 5, 0, imu_delay,  // so that the interval of the last image is closed
      [](double t) { return imu(t); });
  add(end, 50, 1.3, image_delay, [](double t) { return image(t, 0); });
  add(end, 33.3, 2.6, image_delay, [](double t) { return image(t, 1); });
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const Arrival& a, const Arrival& b) { return a.at_ms < b.at_ms; });
  return arrivals;
}

// The rule of the header, checked on what came out: nothing else is needed for a filter to
// interpolate.
void expect_filter_order(const std::vector<SensorSample>& out) {
  std::optional<Instant> imu_before;
  std::optional<Instant> imu_last;
  std::optional<std::pair<Instant, int>> image_last;
  for (const SensorSample& sample : out) {
    const Instant at = time_of(sample);
    if (std::holds_alternative<ImuSample>(sample)) {
      if (imu_last) {
        EXPECT_GT(at, *imu_last);
      }
      imu_before = std::exchange(imu_last, at);
      continue;
    }
    ASSERT_TRUE(imu_last);
    EXPECT_GE(*imu_last, at) << "released before its interval was closed";
    if (imu_before) {
      EXPECT_LT(*imu_before, at) << "released after a later interval";
    }
    const std::pair<Instant, int> image_now{at, std::get<CornerFrame>(sample).camera};
    if (image_last) {
      EXPECT_GT(image_now, *image_last);
    }
    image_last = image_now;
  }
}

TEST_F(SampleMergerTest, RandomDelaysWithinTheWindowChangeNeitherOrderNorNumber) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    make(true, 16, 256);
    std::vector<Arrival> arrivals = random_arrivals(random, 4);
    std::vector<SensorSample> out;
    for (Arrival& arrival : arrivals) {
      push(arrival.sample);
      while (auto sample = merger_->pop()) out.push_back(std::move(*sample));
    }
    merger_->finish();
    while (auto sample = merger_->pop()) out.push_back(std::move(*sample));
    expect_filter_order(out);
    const MergerStatistics& counts = merger_->statistics();
    // A camera is unknown until its first image arrives: what it measured before may be late. Later
    // nothing is.
    EXPECT_LE(counts.late_dropped, 3u) << seed;
    EXPECT_EQ(counts.images_dropped + counts.backwards_dropped + counts.bad_dropped, 0u) << seed;
    EXPECT_EQ(counts.imu_waits_expired, 0u) << seed;
    EXPECT_EQ(out.size() + counts.late_dropped, arrivals.size()) << seed;
  }
}

TEST_F(SampleMergerTest, DelaysBeyondTheWindowCostImagesButNeverTheOrder) {
  std::mt19937 random(7);
  make(true, 4, 256);
  std::vector<Arrival> arrivals = random_arrivals(random, 4);
  std::bernoulli_distribution very_late(0.2);
  for (Arrival& arrival : arrivals) {
    if (!std::holds_alternative<ImuSample>(arrival.sample) && very_late(random))
      arrival.at_ms += 600;
  }
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const Arrival& a, const Arrival& b) { return a.at_ms < b.at_ms; });
  std::vector<SensorSample> out;
  for (Arrival& arrival : arrivals) {
    push(arrival.sample);
    while (auto sample = merger_->pop()) out.push_back(std::move(*sample));
  }
  expect_filter_order(out);
  const MergerStatistics& counts = merger_->statistics();
  EXPECT_GT(counts.late_dropped + counts.backwards_dropped, 10u);
  const auto imu_count = [](const auto& range, auto sample_of) {
    return std::count_if(range.begin(), range.end(), [&](const auto& x) {
      return std::holds_alternative<ImuSample>(sample_of(x));
    });
  };
  EXPECT_GE(imu_count(out, [](const auto& x) { return x; }) + 51,
            imu_count(arrivals, [](const auto& x) { return x.sample; }))
      << "all but those of the last window";
}

TEST_F(SampleMergerTest, AllocatesNothingPerSample) {
  make(true, 8, 256);
  double t = 0;
  const AllocationCounter allocations;
  for (int i = 0; i < 10'000; ++i, t += 5) {
    push(imu(t));
    if (i % 10 == 0) push(image(t - 20));
    while (merger_->pop()) {
    }
  }
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(merger_->statistics().late_dropped + merger_->statistics().images_dropped, 0u);
}

}  // namespace
}  // namespace fiducap
