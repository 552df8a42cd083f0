#include "pipeline/imu_plausibility.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using std::numbers::pi;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

const CameraModel kCameraModel{752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};

/// A camera that turns to and fro in front of a tag, with an IMU in it.
class ImuPlausibilityTest : public testing::Test {
 protected:
  /// @return the faults found within this time
  std::vector<ImuFault> run(double seconds) {
    std::vector<ImuFault> found;
    const int samples = static_cast<int>(seconds * 200);
    for (int i = 0; i < samples; ++i, ++tick_) {
      plausibility_.add(reading());
      if (tick_ % 10 == 0) plausibility_.add(image(), kCameraModel);
      if (const auto fault = plausibility_.take_fault()) found.push_back(*fault);
      all_clears_ += plausibility_.take_all_clear() ? 1 : 0;
    }
    return found;
  }

  void start_again() { plausibility_ = {}; }
  void start_again(double promised_hz) { plausibility_ = ImuPlausibility(promised_hz); }
  [[nodiscard]] std::string text(ImuFault fault) const { return plausibility_.text(fault); }
  void pause(double seconds) { tick_ += static_cast<int>(seconds * 200); }
  /// What a body's pipeline does for every sample.
  void take(const ImuSample& imu, const TagObservations& seen) {
    plausibility_.add(imu);
    plausibility_.add(seen, kCameraModel);
  }
  TagObservations image() {
    const double angle =
        turn_amplitude_rad_ * std::sin(phase()) + attitude_noise_rad_ * noise_(random_);
    const Pose X_WV{exp_so3({0, angle, 0}), {0, 0, 0}};
    const Pose X_WT{exp_so3({pi - 0.4, 0, 0}), {0.1, 0, 1.2}};
    const Pose X_VT = X_WV.inverse() * X_WT;
    TagObservation tag;
    tag.tag_id = 4;
    tag.edge_m = 0.2;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector3d p = X_VT * tag_corner(i, tag.edge_m);
      tag.corners_px[static_cast<std::size_t>(i)] = {460 * p.x() / p.z() + 375.5,
                                                     460 * p.y() / p.z() + 239.5};
      tag.ideal_from_raw[static_cast<std::size_t>(i)].setIdentity();
    }
    TagObservations seen;
    seen.exposed_at = now();
    seen.tags = {tag};
    return seen;
  }

  double turn_amplitude_rad_{0.3};
  double turn_hz_{0.4};
  double force_scale_{1};
  double rate_scale_{1};
  double shake_rad_s_{0};
  double attitude_noise_rad_{0};
  int all_clears_{0};

 private:
  [[nodiscard]] Instant now() const { return instant_from_ns(std::int64_t{tick_} * 5'000'000); }
  [[nodiscard]] double phase() const { return 2 * pi * turn_hz_ * tick_ * 0.005; }
  ImuSample reading() {
    const double rate = turn_amplitude_rad_ * 2 * pi * turn_hz_ * std::cos(phase());
    const double shake = shake_rad_s_ * (tick_ % 2 == 0 ? 1 : -1);
    return {now(), rate_scale_ * Eigen::Vector3d(shake, rate, -shake),
            force_scale_ * Eigen::Vector3d(0.3, 9.8, 0.2)};
  }

  ImuPlausibility plausibility_;
  int tick_{0};
  std::mt19937 random_{3};
  std::normal_distribution<double> noise_;
};

TEST_F(ImuPlausibilityTest, HasNothingAgainstASoundImu) { EXPECT_THAT(run(60), IsEmpty()); }

TEST_F(ImuPlausibilityTest, FindsRatesInDegreesAndSaysItOnce) {
  rate_scale_ = 180 / pi;
  EXPECT_THAT(run(60), ElementsAre(ImuFault::kRateInDegreesPerSecond));
}

TEST_F(ImuPlausibilityTest, FindsForcesInG) {
  force_scale_ = 1 / 9.80665;
  EXPECT_THAT(run(10), ElementsAre(ImuFault::kForceInG));
  EXPECT_TRUE(is_fatal(ImuFault::kForceInG));
}

TEST_F(ImuPlausibilityTest, TellsOtherForcesApart) {
  for (const auto& [scale, fault] : {std::pair(1000 / 9.80665, ImuFault::kForceInMilliG),
                                     std::pair(0.005, ImuFault::kForceWithoutGravity),
                                     std::pair(0.5, ImuFault::kForceUnlikely)}) {
    start_again();
    force_scale_ = scale;
    EXPECT_THAT(run(10), ElementsAre(fault));
  }
}

TEST_F(ImuPlausibilityTest, AStillBodyThatShakesBeforeAnUnsureTagIsNoFault) {
  turn_amplitude_rad_ = 0;
  shake_rad_s_ = 2;
  attitude_noise_rad_ = 0.05;
  EXPECT_THAT(run(120), IsEmpty());
}

TEST_F(ImuPlausibilityTest, SlowTurnsSayNothing) {
  turn_amplitude_rad_ = 0.02;
  rate_scale_ = 180 / pi;
  EXPECT_THAT(run(120), IsEmpty());
}

TEST_F(ImuPlausibilityTest, SaysThatAnImuWasMended) {
  force_scale_ = 1 / 9.80665;
  rate_scale_ = 180 / pi;
  EXPECT_THAT(run(60),
              UnorderedElementsAre(ImuFault::kForceInG, ImuFault::kRateInDegreesPerSecond));
  EXPECT_EQ(all_clears_, 0);
  force_scale_ = 1;
  EXPECT_THAT(run(60), ElementsAre(ImuFault::kRateInDegreesPerSecond)) << "what is left of it";
  EXPECT_EQ(all_clears_, 0);
  rate_scale_ = 1;
  EXPECT_THAT(run(60), IsEmpty());
  EXPECT_EQ(all_clears_, 1);
}

TEST_F(ImuPlausibilityTest, JudgesAnewAfterAPauseTheImuMayBeAnother) {
  EXPECT_THAT(run(30), IsEmpty());
  force_scale_ = 1 / 9.80665;
  rate_scale_ = 180 / pi;
  EXPECT_THAT(run(30), IsEmpty()) << "once it knows it does not look";
  pause(2);
  EXPECT_THAT(run(30),
              UnorderedElementsAre(ImuFault::kForceInG, ImuFault::kRateInDegreesPerSecond));
}

TEST_F(ImuPlausibilityTest, SaysHowReadingsComeAndWhenThatIsOver) {
  start_again(2000);  // ten times what comes
  EXPECT_THAT(run(16), ElementsAre(ImuFault::kFlow));
  EXPECT_NE(text(ImuFault::kFlow).find("gives 200 readings a second, 2000 are configured"),
            std::string::npos);
  EXPECT_FALSE(is_fatal(ImuFault::kFlow));
  EXPECT_THAT(run(30), IsEmpty()) << "once";
  EXPECT_EQ(all_clears_, 0);
}

TEST_F(ImuPlausibilityTest, AStillBodyAllocatesNothing) {
  turn_amplitude_rad_ = 0;
  const TagObservations seen = image();
  const AllocationCounter allocations;
  for (int i = 0; i < 4000; ++i)
    take({seen.exposed_at + std::chrono::milliseconds(5 * i), {0, 0, 0}, {0, 0, 9.81}}, seen);
  EXPECT_EQ(allocations.count(), 0u);
}

TEST_F(ImuPlausibilityTest, AllocatesNothingOnceItKnows) {
  (void)run(60);
  const TagObservations seen = image();
  const AllocationCounter allocations;
  for (int i = 0; i < 1000; ++i) take({seen.exposed_at, {0, 1, 0}, {0, 0, 9.81}}, seen);
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap
