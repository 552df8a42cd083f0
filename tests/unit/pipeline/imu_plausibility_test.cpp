#include "pipeline/imu_plausibility.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "base/pose.hpp"
#include "support/allocation_counter.hpp"
#include "unit/estimation/example_tags.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using std::numbers::pi;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class ImuFlowTest : public testing::Test {
 protected:
  std::optional<ImuFault> run(Duration how_long, Duration period = 5ms) {
    for (const Instant until = now_ + how_long; now_ < until; now_ += period) {
      ++tick_;
      if (repeats_ == 0 || tick_ % repeats_ == 0) value_ += 0.001;
      flow_.add({now_, {value_, 0, 0}, {0, 0, 9.81}});
    }
    return flow_.fault();
  }
  /// Readings with gaps between them.
  std::optional<ImuFault> run_with_gaps(int runs, Duration run_length, Duration gap) {
    for (int i = 0; i < runs; ++i) {
      run(run_length);
      now_ += gap;
    }
    return flow_.fault();
  }
  ImuFlow flow_{200};
  Instant now_{instant_from_ns(1'000'000'000)};
  int tick_{0};
  int repeats_{0};  ///< Every n-th reading is a new one; 0: all.
  double value_{0};
};

TEST_F(ImuFlowTest, JudgesTheRateAndRepeatedReadings) {
  struct Case {
    double configured_hz;
    Duration period;
    int repeats;
    std::optional<ImuFault> fault;
    const char* text;
  };
  for (const auto& [configured_hz, period, repeats, fault, text] :
       {Case{200, 5ms, 0, {}, ""},
        {200, 10ms, 0, {}, ""},
        {0, 100ms, 0, {}, ""},
        {200, 50ms, 0, ImuFault::kSlow, "gives 20 readings a second, 200 are configured"},
        {200, 5ms, 2, ImuFault::kRepeated, "50 % of the IMU's readings repeat the one before"}}) {
    flow_ = ImuFlow(configured_hz);
    repeats_ = repeats;
    EXPECT_EQ(run(60s, period), fault) << text;
    EXPECT_THAT(flow_.text(), HasSubstr(text));
    EXPECT_EQ(flow_.text().empty(), !fault);
  }
}

TEST_F(ImuFlowTest, JudgesFrequentHolesButNotPauses) {
  EXPECT_FALSE(run_with_gaps(10, 4s, 120ms)) << "rare";
  flow_ = ImuFlow(200);
  EXPECT_FALSE(run_with_gaps(15, 1s, 2s)) << "pauses";
  flow_ = ImuFlow(200);
  EXPECT_EQ(run_with_gaps(15, 1s, 120ms), ImuFault::kHoles);
  EXPECT_THAT(flow_.text(), HasSubstr("of up to 125 ms"));
}

TEST_F(ImuFlowTest, FrozenReadingsAreReported) {
  run(10s);
  repeats_ = 1'000'000'000;
  EXPECT_EQ(run(16s), ImuFault::kFrozen);
  EXPECT_THAT(flow_.text(), HasSubstr("frozen"));
}

TEST_F(ImuFlowTest, OneBadWindowIsNoFaultAndThreeGoodOnesEndOne) {
  run(6s);
  run(5s, 50ms);
  EXPECT_FALSE(run(20s));
  EXPECT_TRUE(run(16s, 50ms));
  EXPECT_TRUE(run(12s));
  EXPECT_FALSE(run(10s));
}

const CameraModel kCameraModel{752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};

/// A camera that turns to and fro in front of a tag, with an IMU in it.
class ImuPlausibilityTest : public testing::Test {
 protected:
  /// @return the faults found within this time
  std::vector<ImuFault> run(double seconds) {
    std::vector<ImuFault> found;
    for (const int end = tick_ + static_cast<int>(seconds * 200); tick_ < end; ++tick_) {
      plausibility_.add(reading());
      if (tick_ % 10 == 0) plausibility_.add(image(), kCameraModel);
      const ImuFaults before = std::exchange(faults_, plausibility_.faults());
      for (const ImuFault fault : faults_to_report(before, faults_)) found.push_back(fault);
      all_clears_ += before != faults_ && faults_ == ImuFaults{} ? 1 : 0;
    }
    return found;
  }
  /// What a body's pipeline does for every sample.
  void take(const ImuSample& imu, const TagObservations& seen) {
    plausibility_.add(imu);
    plausibility_.add(seen, kCameraModel);
  }
  void use_wrong_units() {
    force_scale_ = 1 / 9.80665;
    rate_scale_ = 180 / pi;
  }
  TagObservations image() {
    const double angle =
        turn_amplitude_rad_ * std::sin(phase()) + attitude_noise_rad_ * noise_(random_);
    const Pose X_WV{exp_so3({0, angle, 0}), {0, 0, 0}};
    const Pose X_VT = X_WV.inverse() * Pose{exp_so3({pi - 0.4, 0, 0}), {0.1, 0, 1.2}};
    TagObservation tag = example_observation(4, 0.2, X_VT, kCameraModel);
    tag.ideal_from_raw.fill(Eigen::Matrix2d::Identity());
    TagObservations seen;
    seen.exposed_at = now();
    seen.tags = {tag};
    return seen;
  }

  ImuPlausibility plausibility_;
  int tick_{0};
  double turn_amplitude_rad_{0.3};
  double force_scale_{1};
  double rate_scale_{1};
  double shake_rad_s_{0};
  double attitude_noise_rad_{0};
  ImuFaults faults_{};
  int all_clears_{0};

 private:
  static constexpr double kTurn_hz = 0.4;
  [[nodiscard]] Instant now() const { return instant_from_ns(std::int64_t{tick_} * 5'000'000); }
  [[nodiscard]] double phase() const { return 2 * pi * kTurn_hz * tick_ * 0.005; }
  ImuSample reading() {
    const double rate = turn_amplitude_rad_ * 2 * pi * kTurn_hz * std::cos(phase());
    const double shake = shake_rad_s_ * (tick_ % 2 == 0 ? 1 : -1);
    return {now(), rate_scale_ * Eigen::Vector3d(shake, rate, -shake),
            force_scale_ * Eigen::Vector3d(0.3, 9.8, 0.2)};
  }

  std::mt19937 random_{3};
  std::normal_distribution<double> noise_;
};

TEST_F(ImuPlausibilityTest, ASoundImuHasNoFault) { EXPECT_THAT(run(60), IsEmpty()); }

TEST_F(ImuPlausibilityTest, DistinguishesWrongForces) {
  for (const auto& [scale, fault] : {std::pair(1 / 9.80665, ImuFault::kForceInG),
                                     std::pair(1000 / 9.80665, ImuFault::kForceInMilliG),
                                     std::pair(0.005, ImuFault::kForceWithoutGravity),
                                     std::pair(0.5, ImuFault::kForceUnlikely)}) {
    plausibility_ = {};
    force_scale_ = scale;
    EXPECT_THAT(run(10), ElementsAre(fault));
  }
  EXPECT_TRUE(is_fatal(ImuFault::kForceInG));
}

TEST_F(ImuPlausibilityTest, AShakingBodyBeforeAnUncertainTagIsNoFault) {
  turn_amplitude_rad_ = 0;
  shake_rad_s_ = 2;
  attitude_noise_rad_ = 0.05;
  EXPECT_THAT(run(120), IsEmpty());
}

TEST_F(ImuPlausibilityTest, SlowRotationsAreNotJudged) {
  turn_amplitude_rad_ = 0.02;
  rate_scale_ = 180 / pi;
  EXPECT_THAT(run(120), IsEmpty());
}

TEST_F(ImuPlausibilityTest, ReportsThatAnImuWasRepaired) {
  use_wrong_units();
  EXPECT_THAT(run(60),
              UnorderedElementsAre(ImuFault::kForceInG, ImuFault::kRateInDegreesPerSecond));
  EXPECT_EQ(all_clears_, 0);
  force_scale_ = 1;
  EXPECT_THAT(run(60), ElementsAre(ImuFault::kRateInDegreesPerSecond)) << "the other fault is left";
  EXPECT_EQ(all_clears_, 0);
  rate_scale_ = 1;
  EXPECT_THAT(run(60), IsEmpty());
  EXPECT_EQ(all_clears_, 1);
}

TEST_F(ImuPlausibilityTest, TestsAgainAfterAPause) {
  EXPECT_THAT(run(30), IsEmpty());
  use_wrong_units();
  EXPECT_THAT(run(30), IsEmpty()) << "the test has ended";
  tick_ += 400;  // it may be another IMU
  EXPECT_THAT(run(30),
              UnorderedElementsAre(ImuFault::kForceInG, ImuFault::kRateInDegreesPerSecond));
}

TEST_F(ImuPlausibilityTest, ReportsAFaultOfTheFlowOnce) {
  plausibility_ = ImuPlausibility(2000);  // ten times the true rate
  EXPECT_THAT(run(16), ElementsAre(ImuFault::kSlow));
  EXPECT_THAT(plausibility_.text(ImuFault::kSlow),
              HasSubstr("gives 200 readings a second, 2000 are configured"));
  EXPECT_FALSE(is_fatal(ImuFault::kSlow));
  EXPECT_THAT(run(30), IsEmpty());
  EXPECT_EQ(all_clears_, 0);
}

TEST_F(ImuPlausibilityTest, AllocatesNothingBeforeAndAfterItsTestEnds) {
  turn_amplitude_rad_ = 0;
  TagObservations seen = image();
  const AllocationCounter allocations;
  for (int i = 0; i < 4000; ++i) take({seen.exposed_at + i * 5ms, {0, 0, 0}, {0, 0, 9.81}}, seen);
  EXPECT_EQ(allocations.count(), 0u);
  plausibility_ = {};
  turn_amplitude_rad_ = 0.3;
  (void)run(60);
  seen = image();
  const AllocationCounter afterwards;
  for (int i = 0; i < 1000; ++i) take({seen.exposed_at, {0, 1, 0}, {0, 0, 9.81}}, seen);
  EXPECT_EQ(afterwards.count(), 0u);
}

}  // namespace
}  // namespace fiducap
