// What lasts while a tag is in view, told from what is new in every image.
#include "simulation/corner_scatter.hpp"

#include <gtest/gtest.h>

#include <random>

namespace fiducap {
namespace {

constexpr double kSigma_px = 0.05;
constexpr int kVisits = 60;
constexpr int kImages = 80;

/// Errors of a tag seen upright, in sigmas: white ones, and some that stay for a visit.
std::vector<CornerError> errors(double white, double lasting) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> gauss;
  const auto draw = [&] {
    Vector8d out;
    for (double& x : out) x = gauss(random);
    return out;
  };
  std::vector<CornerError> out;
  Instant at = instant_from_ns(0);
  for (int visit = 0; visit < kVisits; ++visit) {
    const Vector8d stays = lasting * draw();
    for (int image = 0; image < kImages; ++image) {
      at += std::chrono::milliseconds(50);
      out.push_back({at,
                     3,
                     {{{10, 30}, {30, 30}, {30, 10}, {10, 10}}},
                     kSigma_px * (stays + white * draw()),
                     kSigma_px});
    }
    at += std::chrono::seconds(5);
  }
  return out;
}

TEST(CornerScatter, TellsWhatLastsFromWhatPasses) {
  const CornerScatter found = corner_scatter(errors(1.0, 0.3));
  EXPECT_NEAR(found.passing.trace() / 8, 1.0, 0.05);
  EXPECT_NEAR(found.lasting.trace() / 8, 0.09, 0.02);
  EXPECT_NEAR(found.lasting_share(), 0.083, 0.02);
  EXPECT_NEAR(found.excess(), std::sqrt(1.09), 0.03);
  EXPECT_NEAR(found.to_next, 0.083, 0.03);
}

TEST(CornerScatter, WhiteErrorsDoNotLast) {
  const CornerScatter found = corner_scatter(errors(1.3, 0.0));
  EXPECT_NEAR(found.passing.trace() / 8, 1.69, 0.05);
  EXPECT_LT(found.lasting_share(), 0.01);
}

TEST(CornerScatter, MisreadTagsAreNotInIt) {
  std::vector<CornerError> some = errors(1.0, 0.0);
  some[5].off_px.setConstant(30);
  EXPECT_NEAR(corner_scatter(some).rms_px, kSigma_px, 0.003);
}

}  // namespace
}  // namespace fiducap
