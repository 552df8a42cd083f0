// The past that filters keep is bounded in time and size.
#include <gtest/gtest.h>
#include <malloc.h>

#include "estimation/imu/imu_buffer.hpp"
#include "estimation/start/tag_candidates.hpp"
#include "estimation/world/image_memory.hpp"
#include "example_room.hpp"
#include "example_tags.hpp"
#include "world/example_state.hpp"

namespace fiducap {
namespace {

constexpr double kMaxGap_s = 0.1;
constexpr double kGapAccel = 3.0;

ImuSample at_rest(double t_s) { return {ExampleRoom::at(t_s), {0, 0, 0}, {0, 0, 9.81}}; }

TEST(ImuBufferPast, IntervalsWithoutReadingsAreGaps) {
  const ImuBuffer empty(ImuNoise{}, kMaxGap_s, kGapAccel);
  ImuBuffer begun = empty;
  begun.push(at_rest(10.0));
  begun.push(at_rest(10.005));
  for (const InertialInput& input :
       {empty.input_between(ExampleRoom::at(1.0), ExampleRoom::at(1.01)),
        begun.input_between(ExampleRoom::at(7.0), ExampleRoom::at(10.0))}) {
    EXPECT_GT(input.gyro_noise, 0.5 * kBlindRate_rad_s_rtHz);
    EXPECT_GT(input.accel_noise, 0.5 * kGapAccel);
  }
}

TEST(ImuBufferPast, RemembersTheObservedEndOfTheRange) {
  constexpr double kRange = 8.7;
  ImuBuffer buffer(ImuNoise{}, kMaxGap_s, kGapAccel);
  const auto push = [&](int i, double most) {
    const Eigen::Vector3d w(0.3 * std::sin(0.1 * i), 10 * std::sin(0.05 * i), std::sin(0.2 * i));
    buffer.push({ExampleRoom::at(0.005 * i),
                 w.cwiseMin(most).cwiseMax(-most),
                 {std::cos(0.03 * i), std::sin(0.07 * i), 9.81 + std::sin(0.1 * i)}});
  };
  for (int i = 0; i < 400; ++i) push(i, 100);
  EXPECT_EQ(buffer.ranges_met().gyro_rad_s, 0);
  for (int i = 400; i < 800; ++i) push(i, kRange);
  EXPECT_EQ(buffer.ranges_met().gyro_rad_s, kRange);
  EXPECT_EQ(buffer.ranges_met().accel_m_s2, 0);
}

TEST(ImuBufferPast, TestsSaturationBeforeReadingsAreCorrected) {
  ImuNoise noise;
  noise.accel_range_m_s2 = 40;
  noise.correction = ImuCorrection{};
  noise.correction->accel_bias_m_s2 = {0.5, 0, 0};
  noise.correction->accel_matrix(0, 0) = 0.9;
  noise.correction->accel_matrix(0, 1) = 0.02;
  ImuBuffer buffer(noise, kMaxGap_s, kGapAccel);
  buffer.push({ExampleRoom::at(10.0), {0, 0, 0}, {39.95, 1, 9.81}});
  EXPECT_TRUE(buffer.newest()->f_B.isApprox(Eigen::Vector3d(0.9 * 39.45 + 0.02, 1, 9.81)));
  EXPECT_EQ(buffer.ranges_met().accel_m_s2, 39.95) << "as the unit reads it";
  EXPECT_EQ(buffer.ranges_met().gyro_rad_s, 0);
}

TEST(ImuBufferPast, KeepsTheSameTimeAtAnyRate) {
  for (const double rate_hz : {100.0, 1000.0, 4000.0}) {
    ImuNoise noise;
    noise.rate_hz = rate_hz;
    ImuBuffer buffer(noise, kMaxGap_s, kGapAccel);
    int pushed = 0;
    while (!buffer.is_full()) buffer.push(at_rest(10.0 + pushed++ / rate_hz));
    EXPECT_GE(pushed / rate_hz, to_seconds(kFilterPast)) << rate_hz << " Hz";
    EXPECT_LE(pushed / rate_hz, 2 * to_seconds(kFilterPast) + 1) << rate_hz << " Hz";
  }
}

class BoundedPast : public BothFilters {};
INSTANTIATE_TEST_SUITE_P(Filters, BoundedPast, kBothFilters, name_of_filter);

// Six images and a thousand readings a second: the images that a waiting tag remembers reach
// further back than four thousand readings.
TEST_P(BoundedPast, ASlowCameraAndAFastImuLoseNothing) {
  ExampleRoom::Setup setup = BoundedPast::setup();
  setup.image_period_s = 1.0 / 6;
  setup.imu_period_s = 0.001;
  // Tag 0 is shown rarely, so that it waits for long.
  for (int joins = 50; joins < 62; joins += 3) {
    ExampleRoom room(setup);
    for (int i = 0; i < 80; ++i) {
      const bool shows = i >= 45 && (i < 47 || i >= joins);
      room.next_image({}, shows ? std::vector<int>{} : std::vector<int>{1, 2, 3, 4, 5});
      if (i >= 45 && room.filter->running()) EXPECT_LT(room.sigma_m(), 0.1) << "joins at " << joins;
    }
    ASSERT_TRUE(room.belief(1));
    room.expect_belief(0, 0.02, room.belief(1)->tag.X_WT * room.tags[1].inverse());
  }
}

TEST_P(BoundedPast, ImagesWithoutReadingsDoNotGrowMemory) {
  ExampleRoom::Setup setup = BoundedPast::setup();
  setup.image_period_s = 0.1;
  ExampleRoom room(setup);
  room.images(4);
  TagObservations seen = room.look({});
  const auto used_after_images = [&] {
    for (int i = 0; i < 400; ++i) {
      seen.exposed_at += std::chrono::milliseconds(100);
      room.filter->update(seen, {});
    }
    return mallinfo2().uordblks;
  };
  const std::size_t before = used_after_images();
  // The log of a start may fill, but a minute of images weighs a megabyte.
  EXPECT_LT(used_after_images(), before + 256 * 1024);
}

const CameraModel kLens = example_camera();
const Eigen::Quaterniond kAttitude = exp_so3({2.6, 0.4, 0.3});

/// A tag before a camera that is turned by `turn`, of which the gyro is off about y.
auto judge(TagCandidates& candidates, int id, double t_s,
           const Eigen::Vector3d& turn = Eigen::Vector3d::Zero(), double gyro_error_rad = 0) {
  const Eigen::Quaterniond q_WV = exp_so3(turn);
  const TagObservation seen =
      example_observation(id, 0.2, {q_WV.conjugate() * kAttitude, {0.2, 0.1, 1.5}}, kLens);
  const CameraAttitude attitude{exp_so3({0, gyro_error_rad, 0}) * q_WV};
  return candidates.judge(0, ExampleRoom::at(t_s), seen, kLens, 0.4, attitude, {.at_least = 3});
}

TEST(TagCandidatesPast, AnOldViewIsNotUsed) {
  TagCandidates candidates{EstimatorConfig{}};
  EXPECT_FALSE(judge(candidates, 7, 0.0));
  EXPECT_FALSE(judge(candidates, 7, 0.05));
  // Minutes later, with a gyro that has drifted since.
  EXPECT_FALSE(judge(candidates, 7, 200.0, {0.1, 0, 0}, 0.3));
  EXPECT_FALSE(judge(candidates, 7, 200.05, {0.12, 0.1, 0}, 0.3));
  const auto verdict = judge(candidates, 7, 200.1, {0.0, 0.2, 0}, 0.3);
  ASSERT_TRUE(verdict);
  EXPECT_LT(angle_between(*verdict->q_WT, exp_so3({0, 0.3, 0}) * kAttitude), 0.02);
}

TEST(TagCandidatesPast, ATagSeenOnceIsForgotten) {
  TagCandidates candidates{EstimatorConfig{}};
  for (int id = 0; id < 500; ++id) (void)judge(candidates, id, 0.5 * id);
  EXPECT_LT(candidates.size(), 30u);
}

TEST(DroppedTag, DoesNotReturnWithAnEarlierState) {
  world::FilterState state = world::example_state();
  world::ImageMemory memory;
  TagObservations seen;
  const auto show = [&](double t_s) {
    seen.exposed_at = ExampleRoom::at(t_s);
    state.time = seen.exposed_at;
    const KnownTag known{12, 0.2, Pose{}, Matrix6d::Identity()};
    memory.add(seen, {&known, 1});
  };
  show(1.0);
  memory.image(memory.newest()).admissions.push_back({11, Pose{}});
  memory.wait(30, Eigen::Quaterniond::Identity(), state);
  memory.wait(11, Eigen::Quaterniond::Identity(), state);
  show(1.05);
  memory.forget_tag(11);
  memory.forget_tag(12);
  const auto first = memory.first_sight(30);
  ASSERT_TRUE(first);
  const auto* earlier = memory.state_at(first->number);
  EXPECT_LT(earlier->find(11), 0);
  EXPECT_LT(earlier->find(12), 0);
  EXPECT_GE(earlier->find(10), 0);
  EXPECT_TRUE(memory.image(first->number).admissions.empty());
  EXPECT_TRUE(memory.image(first->number).known.empty());
  EXPECT_FALSE(memory.first_sight(11));
}

TEST(ImageMemoryPast, IsBoundedInTime) {
  const world::FilterState start = world::example_state();
  world::ImageMemory memory;
  for (int i = 0; i < 30; ++i) {
    TagObservations seen;
    seen.exposed_at = ExampleRoom::at(0.5 * i);
    world::FilterState state = start;
    state.time = seen.exposed_at;
    memory.add(seen, {});
    memory.wait(100 + i, Eigen::Quaterniond::Identity(), state);
    ASSERT_TRUE(memory.needed_since());
    EXPECT_LE(seen.exposed_at - *memory.needed_since(), kFilterPast) << "image " << i;
  }
}

}  // namespace
}  // namespace fiducap
