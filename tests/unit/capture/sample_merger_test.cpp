#include "capture/sample_merger.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>
#include <random>
#include <string>

#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::IsEmpty;

Instant ms(double t) { return instant_from_ns(static_cast<std::int64_t>(t * 1e6)); }
ImuSample imu(double t_ms) { return {ms(t_ms), {0.1, 0.2, 0.3}, {0, 0, 9.81}}; }
CornerFrame image(double t_ms, int camera = 0) { return {camera, ms(t_ms), {}}; }

std::string name_of(const SensorSample& sample) {
  const std::string t = std::to_string(to_ns(time_of(sample)) / 1'000'000);
  if (std::holds_alternative<ImuSample>(sample)) return "imu" + t;
  return "cam" + std::to_string(std::get<CornerFrame>(sample).camera) + "@" + t;
}

std::vector<std::string> names_of(const std::vector<SensorSample>& samples) {
  std::vector<std::string> names;
  for (const SensorSample& sample : samples) names.push_back(name_of(sample));
  return names;
}

struct Arrival {
  double at_ms;
  SensorSample sample;
};

class SampleMergerTest : public testing::Test {
 protected:
  void make(bool has_imu, std::size_t max_images = 8, std::size_t max_imu = 64) {
    merger_.emplace(MergerConfig{.has_imu = has_imu, .max_images = max_images, .max_imu = max_imu});
  }
  template <typename... Samples>
  void push(const Samples&... samples) {
    for (const SensorSample& sample : {SensorSample(samples)...})
      EXPECT_TRUE(merger_->push(sample));
  }
  void push_imu(double from_ms, double to_ms, double step_ms) {
    for (double t = from_ms; t <= to_ms; t += step_ms) push(imu(t));
  }
  std::vector<SensorSample> pop_all() {
    std::vector<SensorSample> samples;
    while (auto sample = merger_->pop()) samples.push_back(std::move(*sample));
    return samples;
  }
  std::vector<std::string> drain() { return names_of(pop_all()); }
  std::vector<SensorSample> run(const std::vector<Arrival>& arrivals, bool to_the_end) {
    std::vector<SensorSample> out;
    const auto take = [&] {
      while (auto sample = merger_->pop()) out.push_back(std::move(*sample));
    };
    for (const Arrival& arrival : arrivals) {
      push(arrival.sample);
      take();
    }
    if (to_the_end) merger_->finish();
    take();
    return out;
  }
  MergerStatistics counts() const { return merger_->statistics(); }

  std::optional<SampleMerger> merger_{MergerConfig{}};
};

TEST_F(SampleMergerTest, MovesImagesByTheClockShiftAndNotesIt) {
  merger_->set_clock_shift(0, milliseconds(6));
  push_imu(0, 15, 5);
  push(image(7));
  const auto samples = pop_all();
  EXPECT_THAT(names_of(samples), ElementsAre("imu0", "imu5", "imu10", "imu15", "cam0@13"));
  EXPECT_EQ(clock_shift_of(samples.back()), milliseconds(6));
}

TEST_F(SampleMergerTest, DropsAWaitingImageThatAShiftMakesLate) {
  make(false);
  push(image(0, 1), image(10, 0), image(12, 1));
  EXPECT_THAT(drain(), ElementsAre("cam1@0", "cam0@10")) << "cam1@12 waits for camera 0";
  merger_->set_clock_shift(1, milliseconds(-5));
  push(image(20, 0));
  EXPECT_THAT(drain(), IsEmpty()) << "cam1@7 would be older than cam0@10";
  EXPECT_EQ(counts().late_dropped, 1u);
  push(image(30, 1));
  EXPECT_THAT(drain(), ElementsAre("cam0@20"));
}

TEST_F(SampleMergerTest, SortsTwoImagesWithinOneImuInterval) {
  push(imu(0), image(7, 0), image(6, 1), imu(10));
  EXPECT_THAT(drain(), ElementsAre("imu0", "imu10", "cam1@6"))
      << "camera 1 may still deliver an image of 6.5";
  push(image(57, 1));
  EXPECT_THAT(drain(), ElementsAre("cam0@7"));
}

TEST_F(SampleMergerTest, SortsSimultaneousImagesByCamera) {
  push(imu(0), image(3, 0), image(3, 1), imu(5));
  drain();
  push(image(53, 1), image(53, 0), imu(60), imu(65));
  EXPECT_THAT(drain(), ElementsAre("imu60", "cam0@53", "cam1@53"));
}

TEST_F(SampleMergerTest, DelaysImuSamplesWithoutImagesByTheWindow) {
  push_imu(0, 200, 10);
  EXPECT_THAT(drain(), ElementsAre("imu0"));
  push_imu(210, 300, 10);
  EXPECT_EQ(drain().back(), "imu50");
}

TEST_F(SampleMergerTest, ReleasesAnImageWithoutImuSamplesAfterTheWindow) {
  push(imu(0), image(10), image(60), image(250));
  EXPECT_THAT(drain(), ElementsAre("imu0"));
  push(image(270));
  EXPECT_THAT(drain(), ElementsAre("cam0@10"));
  EXPECT_EQ(counts().imu_waits_expired, 1u);
  push(imu(5));  // too late: the image at 10 is out
  EXPECT_EQ(counts().late_dropped, 1u);
}

TEST_F(SampleMergerTest, DropsTheOldestImageOfAFullQueue) {
  make(true, 2);
  push(imu(0), image(1), image(2), image(3), image(4), imu(5));
  EXPECT_THAT(drain(), ElementsAre("imu0", "imu5", "cam0@3", "cam0@4"));
  EXPECT_EQ(counts().images_dropped, 2u);
}

TEST_F(SampleMergerTest, RefusesImuSamplesWhenTheirQueueIsFull) {
  make(true, 2, 3);
  push(imu(0), imu(1), imu(2));
  EXPECT_FALSE(merger_->push(imu(3)));
  EXPECT_THAT(drain(), ElementsAre("imu0"));
  EXPECT_TRUE(merger_->push(imu(3))) << "the refused sample was not taken as seen";
}

TEST_F(SampleMergerTest, DropsAndCountsStampsThatDoNotIncrease) {
  push(imu(10), imu(10), imu(5), image(20, 0), image(20, 0), image(15, 0));
  push(image(15, 1));  // another camera has its own time
  EXPECT_EQ(counts().backwards_dropped, 4u);
  merger_->finish();
  EXPECT_THAT(drain(), ElementsAre("imu10", "cam1@15", "cam0@20"));
}

TEST_F(SampleMergerTest, DropsAndCountsInvalidSamples) {
  ImuSample no_rate = imu(0);
  no_rate.w_WB_B.y() = std::numeric_limits<double>::quiet_NaN();
  ImuSample no_force = imu(0);
  no_force.f_B.z() = std::numeric_limits<double>::infinity();
  CornerFrame frame = image(1);
  frame.tags.push_back({});
  frame.tags[0].corners_px.fill({1, 1});
  frame.tags[0].corners_px[3].x() = std::numeric_limits<double>::quiet_NaN();
  push(no_rate, no_force, frame, CameraFrame{0, ms(1), nullptr},
       CameraFrame{0, ms(1), std::make_shared<GrayImage>()}, image(1, -1), image(1, 1000));
  merger_->finish();
  EXPECT_THAT(drain(), IsEmpty());
  EXPECT_EQ(counts().bad_dropped, 7u);
}

TEST_F(SampleMergerTest, HoldsTheFirstImageOfACameraWithoutImu) {
  make(false);
  push(imu(1), image(5), image(55));  // the IMU sample is unused
  EXPECT_THAT(drain(), ElementsAre("cam0@5", "cam0@55"));
  push(image(105));
  EXPECT_THAT(drain(), ElementsAre("cam0@105"));
}

TEST_F(SampleMergerTest, DropsOnlyTheStampsOfTheFuture) {
  std::size_t out = 0;
  push(imu(1e9));
  for (double t = 0; t <= 400; t += 10) {
    push(imu(t == 200 ? 2e9 : t), image(t == 100 ? 3e9 : t));
    out += drain().size();
  }
  merger_->finish();
  EXPECT_EQ(out + drain().size(), 40u + 40u);
  EXPECT_EQ(counts().far_dropped, 3u);
  EXPECT_EQ(counts().backwards_dropped + counts().late_dropped, 0u);
}

TEST_F(SampleMergerTest, SortsImagesOfSeveralCamerasWithoutImu) {
  make(false);
  push(image(0, 0), image(0, 1));
  drain();
  push(image(60, 1));
  EXPECT_THAT(drain(), IsEmpty());
  push(image(50, 0));
  EXPECT_THAT(drain(), ElementsAre("cam0@50"));
  push(image(100, 0));
  EXPECT_THAT(drain(), ElementsAre("cam1@60"));
}

TEST_F(SampleMergerTest, WaitsForAFailedCameraNoLongerThanTheWindow) {
  make(false);
  push(image(0, 0), image(0, 1));
  drain();
  for (double t = 50; t <= 250; t += 50) push(image(t, 0));
  EXPECT_THAT(drain(), IsEmpty());
  push(image(300, 0));
  EXPECT_EQ(drain().size(), 6u);
  push(image(350, 0));
  EXPECT_THAT(drain(), ElementsAre("cam0@350"));
}

TEST_F(SampleMergerTest, ReleasesTheRestAtTheEnd) {
  push(imu(0), imu(5), imu(10), image(7), image(12));
  merger_->finish();
  EXPECT_THAT(drain(), ElementsAre("imu0", "imu5", "imu10", "cam0@7", "cam0@12"));
  EXPECT_EQ(counts().imu_waits_expired, 1u) << "the interval of the last image stays open";
}

void sort_by_time(std::vector<Arrival>& arrivals) {
  std::ranges::stable_sort(arrivals, {}, &Arrival::at_ms);
}

// Samples of a body with 200 Hz IMU and two cameras, each with a random delay; within one sensor
// the order of arrival is kept.
std::vector<Arrival> random_arrivals(std::mt19937& random, double duration_s) {
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
  const double end = duration_s * 1000;
  add(end + 10, 5, 0, imu_delay, imu);  // closes the interval of the last image
  add(end, 50, 1.3, image_delay, [](double t) { return image(t, 0); });
  add(end, 33.3, 2.6, image_delay, [](double t) { return image(t, 1); });
  sort_by_time(arrivals);
  return arrivals;
}

// The order that a filter needs to interpolate.
void expect_filter_order(const std::vector<SensorSample>& out) {
  constexpr Instant kNever = instant_from_ns(-1);
  Instant imu_before = kNever;
  Instant imu_last = kNever;
  std::pair<Instant, int> image_last{kNever, 0};
  for (const SensorSample& sample : out) {
    const Instant at = time_of(sample);
    if (std::holds_alternative<ImuSample>(sample)) {
      EXPECT_GT(at, imu_last);
      imu_before = std::exchange(imu_last, at);
      continue;
    }
    EXPECT_GE(imu_last, at) << "released before its interval was closed";
    EXPECT_LT(imu_before, at) << "released after a later interval";
    const std::pair<Instant, int> image_now{at, std::get<CornerFrame>(sample).camera};
    EXPECT_GT(image_now, image_last);
    image_last = image_now;
  }
}

TEST_F(SampleMergerTest, KeepsOrderAndNumberUnderDelaysWithinTheWindow) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    make(true, 16, 256);
    const std::vector<Arrival> arrivals = random_arrivals(random, 4);
    const std::vector<SensorSample> out = run(arrivals, true);
    expect_filter_order(out);
    // A camera is unknown until its first image arrives, so only images before that may be late.
    EXPECT_LE(counts().late_dropped, 3u) << seed;
    EXPECT_EQ(counts().images_dropped + counts().backwards_dropped + counts().bad_dropped, 0u)
        << seed;
    EXPECT_EQ(counts().imu_waits_expired, 0u) << seed;
    EXPECT_EQ(out.size() + counts().late_dropped, arrivals.size()) << seed;
  }
}

TEST_F(SampleMergerTest, KeepsTheOrderUnderDelaysBeyondTheWindow) {
  std::mt19937 random(7);
  make(true, 4, 256);
  std::vector<Arrival> arrivals = random_arrivals(random, 4);
  const auto is_imu = [](const SensorSample& s) { return std::holds_alternative<ImuSample>(s); };
  std::bernoulli_distribution very_late(0.2);
  for (Arrival& arrival : arrivals)
    if (!is_imu(arrival.sample) && very_late(random)) arrival.at_ms += 600;
  sort_by_time(arrivals);
  const std::vector<SensorSample> out = run(arrivals, false);
  expect_filter_order(out);
  EXPECT_GT(counts().late_dropped + counts().backwards_dropped, 10u);
  EXPECT_GE(std::ranges::count_if(out, is_imu) + 51,
            std::ranges::count_if(arrivals, is_imu, &Arrival::sample))
      << "all but those of the last window";
}

TEST_F(SampleMergerTest, AllocatesNothingPerSample) {
  make(true, 8, 256);
  double t = 0;
  const AllocationCounter allocations;
  for (int i = 0; i < 10'000; ++i, t += 5) {
    ASSERT_TRUE(merger_->push(imu(t)));
    ASSERT_TRUE(i % 10 != 0 || merger_->push(image(t - 20)));
    while (merger_->pop()) {
    }
  }
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(counts().late_dropped + counts().images_dropped, 0u);
}

}  // namespace
}  // namespace fiducap
