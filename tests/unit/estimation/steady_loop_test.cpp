// Bodies at rest before tags that do not change; the past that filters keep is bounded in time and
// size; readings that saturate.
#include <gtest/gtest.h>
#include <malloc.h>

#include <cmath>
#include <random>

#include "estimation/body_filter.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/start/tag_candidates.hpp"
#include "estimation/world/image_memory.hpp"
#include "example_room.hpp"
#include "example_tags.hpp"
#include "support/allocation_counter.hpp"
#include "support/results.hpp"
#include "world/example_state.hpp"

namespace fiducap {
namespace {

class AtRest : public testing::Test {
 protected:
  explicit AtRest(bool has_imu = true) {
    CameraMount mount;
    mount.model = example_camera();
    BodySensors sensors{.cameras = {mount}, .imu = {}};
    if (has_imu) sensors.imu = ImuNoise{};
    filter_ = make_body_filter("world", sensors, WorkspaceGauge{}, EstimatorConfig{});
  }
  void add_tag(const Eigen::Vector3d& p_VT) {
    seen_.tags.push_back(example_observation(static_cast<int>(seen_.tags.size()), 0.2,
                                             {exp_so3({2.6, 0.4, 0.3}), p_VT}, example_camera()));
  }

  std::unique_ptr<BodyFilter> filter_;
  TagObservations seen_;
  Instant now_{};
};

class SteadyLoop : public AtRest {
 protected:
  static constexpr int kTags = 12;

  SteadyLoop() {
    for (int i = 0; i < kTags; ++i) add_tag({-0.6 + 0.3 * (i % 4), -0.4 + 0.4 * (i / 4), 2.0});
  }
  void read(int samples) {
    for (int i = 0; i < samples; ++i) {
      now_ += std::chrono::milliseconds(5);
      filter_->propagate({now_, Eigen::Vector3d::Zero(), {0, 0, 9.81}});
    }
  }
  void run_images(int count) {
    for (int i = 0; i < count; ++i) {
      read(10);
      seen_.exposed_at = now_ - std::chrono::milliseconds(2);
      report_ = filter_->update(seen_, {});
      if (filter_->running()) filter_->tag_beliefs(beliefs_);
    }
  }

  UpdateReport report_;
  std::vector<TagBelief> beliefs_;
};

TEST_F(SteadyLoop, AllocatesNothingAfterWarmUpAndTheEstimateIsConstant) {
  run_images(150);  // the start is kept for six seconds
  ASSERT_EQ(report_.tags_used, kTags);
  const BodyEstimate before = filter_->estimate();
  const AllocationCounter allocations;
  run_images(20);
  EXPECT_EQ(allocations.count(), 0u);
  const BodyEstimate after = filter_->estimate();
  EXPECT_LT((after.X_WB.p - before.X_WB.p).norm(), 1e-6);
  EXPECT_LT(after.v_WB.norm(), 1e-5);
  read(1000);
  const AllocationCounter without_images;
  read(5000);
  EXPECT_EQ(without_images.count(), 0u);
}

TEST_F(SteadyLoop, BadReadingsAreIgnored) {
  run_images(60);
  const BodyEstimate before = filter_->estimate();
  filter_->propagate({now_ - std::chrono::seconds(1), {1, 1, 1}, {0, 0, 0}});
  filter_->propagate({now_ + std::chrono::microseconds(1), {std::nan(""), 0, 0}, {0, 0, 9.81}});
  run_images(1);
  EXPECT_LT((filter_->estimate().X_WB.p - before.X_WB.p).norm(), 1e-5);
}

class WithoutImu : public AtRest {
 protected:
  WithoutImu() : AtRest(false) {
    for (int i = 0; i < 3; ++i) add_tag({-0.6 + 0.6 * i, 0.1, 2.0});
  }
  UpdateReport show(TagObservations seen) {
    seen.exposed_at = now_ += std::chrono::milliseconds(50);
    return filter_->update(seen, {});
  }
};

TEST_F(WithoutImu, RestartsAfterALongContradiction) {
  TagObservations torn = seen_;  // corners that no square can have
  for (TagObservation& tag : torn.tags)
    for (std::size_t c = 0; c < 4; ++c) tag.corners_px[c].x() += c % 2 == 0 ? 15.0 : -15.0;
  for (int i = 0; i < 20; ++i) show(seen_);
  ASSERT_TRUE(filter_->running());
  for (int i = 0; i < 40; ++i) EXPECT_EQ(show(torn).tags_used, 0) << "image " << i;
  for (int i = 0; i < 20; ++i) show(seen_);
  ASSERT_TRUE(filter_->running());
  EXPECT_TRUE(filter_->estimate().anchored);
  EXPECT_EQ(filter_->estimate().at, now_);
  EXPECT_EQ(show(seen_).tags_used, 3);
}

// Six images and a thousand readings a second: the images that a waiting tag remembers reach
// further back than four thousand readings.
TEST(BoundedPast, ASlowCameraAndAFastImuLoseNothing) {
  ExampleRoom::Setup setup;
  setup.image_period_s = 1.0 / 6;
  setup.imu_period_s = 0.001;
  // Tag 0 is shown rarely, so that it waits for long.
  for (int joins = 50; joins < 62; joins += 3) {
    ExampleRoom room(setup);
    for (int i = 0; i < 80; ++i) {
      const bool shows = i >= 45 && (i < 47 || i >= joins);
      room.next_image({}, shows ? std::vector<int>{} : std::vector<int>{1, 2, 3, 4, 5});
      if (i >= 45 && room.filter->running()) {
        EXPECT_LT(room.sigma_m(), 0.1) << "joins at " << joins;
      }
    }
    ASSERT_TRUE(room.belief(1));
    room.expect_belief(0, 0.02, room.belief(1)->tag.X_WT * room.tags[1].inverse());
  }
}

TEST(BoundedPast, ImagesWithoutReadingsDoNotGrowMemory) {
  ExampleRoom::Setup setup;
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
  const auto verdict = value_of(judge(candidates, 7, 200.1, {0.0, 0.2, 0}, 0.3));
  EXPECT_LT(angle_between(*verdict.q_WT, exp_so3({0, 0.3, 0}) * kAttitude), 0.02);
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
  const auto first = value_of(memory.first_sight(30));
  const auto* earlier = memory.state_at(first.number);
  EXPECT_LT(earlier->find(11), 0);
  EXPECT_LT(earlier->find(12), 0);
  EXPECT_GE(earlier->find(10), 0);
  EXPECT_TRUE(memory.image(first.number).admissions.empty());
  EXPECT_TRUE(memory.image(first.number).known.empty());
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

/// A body that turns and shakes, read by a unit with this resolution and range.
class Unit {
 public:
  Unit(double resolution, double noise) : resolution_(resolution), noise_(noise) {}

  ImuSample read(double motion, double range) {
    const double t = 0.005 * static_cast<double>(k_++);
    ImuSample imu;
    for (int i = 0; i < 3; ++i) {
      imu.w_WB_B(i) = reading(motion * std::sin(3 * t + i), range);
      imu.f_B(i) = reading(motion * std::cos(2 * t + i) + (i == 2 ? 9.81 : 0.0), 100.0);
    }
    return imu;
  }

 private:
  double reading(double value, double range) {
    value = std::clamp(value + noise_ * gauss_(random_), -range, range);
    return resolution_ > 0 ? resolution_ * std::round(value / resolution_) : value;
  }

  double resolution_;
  double noise_;
  long k_{0};
  std::mt19937 random_{3};
  std::normal_distribution<double> gauss_;
};

constexpr int kReadings = 4000;

TEST(SaturationWatch, AnUnsaturatedSensorIsNotReported) {
  struct Case {
    const char* what;
    double resolution, noise, motion, motion_afterwards;
    int most;  ///< Reports.
  };
  for (const auto& [what, resolution, noise, motion, motion_afterwards, most] :
       {Case{"a fine one in motion", 0, 0.01, 1, 1, 0},
        {"a coarse one at rest, noise of half its resolution", 0.001, 0.0005, 0, 0, 2},
        {"of its resolution", 0.001, 0.001, 0, 0, 2},
        {"of three times its resolution", 0.001, 0.003, 0, 0, 2},
        {"without noise, then at rest", 0, 0, 1, 0, 0}}) {
    SaturationWatch watch{ImuNoise{}};
    Unit unit(resolution, noise);
    int reported = 0;
    for (int k = 0; k < kReadings; ++k) {
      const auto found =
          watch.look_at(unit.read(k < kReadings / 2 ? motion : motion_afterwards, 10));
      reported += found.now.gyro || found.now.accel ? 1 : 0;
    }
    EXPECT_LE(reported, most) << what;
  }
}

TEST(SaturationWatch, AFlatTopIsFoundWithAllItsReadings) {
  for (const double resolution : {0.0, 0.001}) {
    SaturationWatch watch{ImuNoise{}};
    Unit unit(resolution, 0.003);
    for (int k = 0; k < 400; ++k) (void)watch.look_at(unit.read(1.0, 10));
    int cut = 0;
    int missed = 0;
    std::size_t before = 0;
    for (int k = 0; k < 400; ++k) {
      const ImuSample imu = unit.read(1.0, 0.5);
      const bool at_end = imu.w_WB_B.cwiseAbs().maxCoeff() >= 0.5;
      const auto found = watch.look_at(imu);
      cut += at_end ? 1 : 0;
      missed += at_end && !found.now.gyro ? 1 : 0;
      before += found.gyro_since;
      EXPECT_FALSE(found.now.accel);
    }
    EXPECT_GT(cut, 200);
    // Late detections are reported afterwards; only peaks of a few readings stay undetected.
    EXPECT_LT(missed - static_cast<int>(before), 0.08 * cut) << resolution;
  }
}

TEST(SaturationWatch, AKnownRangeIsFoundAtOnce) {
  ImuNoise noise;
  noise.gyro_range_rad_s = 0.5;
  SaturationWatch watch{noise};
  ImuSample imu;
  imu.w_WB_B = {0.1, -0.5, 0.2};
  EXPECT_TRUE(watch.look_at(imu).now.gyro);
  imu.w_WB_B = {0.1, -0.49, 0.2};
  EXPECT_FALSE(watch.look_at(imu).now.gyro);
}

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

}  // namespace
}  // namespace fiducap
