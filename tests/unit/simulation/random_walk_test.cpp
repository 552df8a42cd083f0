#include "simulation/sensor_models.hpp"

#include <gtest/gtest.h>

namespace fiducap::simulation {
namespace {

TEST(RandomWalk, StartsAtZero) { EXPECT_EQ(RandomWalk(1, Purpose::kGyroWalk).at(0).norm(), 0.0); }

TEST(RandomWalk, StepsHaveVarianceOneAndDoNotKnowEachOther) {
  RandomWalk walk(5, Purpose::kGyroWalk);
  constexpr int kSteps = 20000;
  double square = 0;
  double neighbours = 0;
  Eigen::Vector3d last_step = Eigen::Vector3d::Zero();
  for (int k = 0; k < kSteps; ++k) {
    const Eigen::Vector3d before = walk.at(static_cast<std::uint64_t>(k));
    const Eigen::Vector3d step = walk.at(static_cast<std::uint64_t>(k) + 1) - before;
    square += step.squaredNorm();
    neighbours += step.dot(last_step);
    last_step = step;
  }
  constexpr double kFiveSigma = 5 * 1.4142 / 245;  // √2 / √(3 · 20000)
  EXPECT_NEAR(square / (3 * kSteps), 1.0, kFiveSigma);
  EXPECT_NEAR(neighbours / (3 * kSteps), 0.0, kFiveSigma);
}

TEST(RandomWalk, SpreadGrowsWithTheRootOfTime) {
  constexpr int kWalks = 2000;
  for (const std::uint64_t ticks : {100ULL, 10000ULL, 1000000ULL}) {
    double square = 0;
    for (int i = 0; i < kWalks; ++i)
      square +=
          RandomWalk(static_cast<std::uint64_t>(i), Purpose::kAccelWalk).at(ticks).squaredNorm();
    constexpr double kFiveSigma = 5 * 1.4142 / 77.5;  // √2 / √(3 · 2000)
    EXPECT_NEAR(square / (3.0 * kWalks * static_cast<double>(ticks)), 1.0, kFiveSigma) << ticks;
  }
}

TEST(RandomWalk, TheOrderOfAskingChangesNothing) {
  RandomWalk forward(9, Purpose::kGyroWalk);
  std::vector<Eigen::Vector3d> seen;
  for (std::uint64_t k = 0; k < 500; ++k) seen.push_back(forward.at(k));
  RandomWalk backward(9, Purpose::kGyroWalk);
  (void)backward.at(1'000'000'000'000);
  for (std::uint64_t k = 500; k-- > 0;) EXPECT_EQ(backward.at(k), seen[k]);
}

TEST(RandomWalk, PurposesAndSeedsAreIndependent) {
  EXPECT_NE(RandomWalk(1, Purpose::kGyroWalk).at(10), RandomWalk(1, Purpose::kAccelWalk).at(10));
  EXPECT_NE(RandomWalk(1, Purpose::kGyroWalk).at(10), RandomWalk(2, Purpose::kGyroWalk).at(10));
}

}  // namespace
}  // namespace fiducap::simulation
