// Separates persistent corner errors from those that are new in every image.
#include "simulation/corner_scatter.hpp"

#include <gtest/gtest.h>

#include <random>

namespace fiducap {
namespace {

constexpr double kSigma_px = 0.05;
constexpr int kVisits = 60;
constexpr int kVisitImages = 80;
constexpr double kFrame_s = 0.05;
constexpr double kTrueFades_s = 0.9;

/// Errors of a tag seen upright, in sigmas: white ones, and some that fade.
std::vector<CornerError> errors(double white, double lasting, double side_px = 40) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> gauss;
  const auto draw = [&] {
    Vector8d out;
    for (double& x : out) x = gauss(random);
    return out;
  };
  std::vector<CornerError> out;
  Instant at = instant_from_ns(0);
  const double a = std::exp(-kFrame_s / kTrueFades_s);
  const double end_px = 10 + side_px;
  for (int visit = 0; visit < kVisits; ++visit) {
    Vector8d stays = lasting * draw();
    for (int image = 0; image < kVisitImages; ++image) {
      at += from_seconds(kFrame_s);
      stays = a * stays + std::sqrt(1 - a * a) * lasting * draw();
      out.push_back({at,
                     3,
                     {{{10, end_px}, {end_px, end_px}, {end_px, 10}, {10, 10}}},
                     kSigma_px * (stays + white * draw()),
                     kSigma_px});
    }
    at += std::chrono::seconds(5);
  }
  return out;
}

CornerScatter scatter_of(const std::vector<CornerError>& errors) {
  return corner_scatter(std::span(&errors, 1));
}

TEST(CornerScatter, SeparatesLastingFromWhiteErrors) {
  const CornerScatter found = scatter_of(errors(1.0, 0.3));
  EXPECT_NEAR(found.wide.passing.trace() / 8, 1.0, 0.05);
  EXPECT_NEAR(found.wide.lasting.trace() / 8, 0.09, 0.02);
  EXPECT_NEAR(found.fades_s, kTrueFades_s, 0.3 * kTrueFades_s);
  EXPECT_NEAR(found.lasting_share, 0.083, 0.02);
  EXPECT_NEAR(found.excess(), std::sqrt(1.09), 0.03);
  EXPECT_NEAR(found.to_next, 0.083, 0.03);
}

TEST(CornerScatter, WhiteErrorsDoNotLast) {
  const CornerScatter found = scatter_of(errors(1.3, 0.0));
  EXPECT_NEAR(found.wide.passing.trace() / 8, 1.69, 0.05);
  EXPECT_LT(found.lasting_share, 0.01);
}

TEST(CornerScatter, NarrowTagsAreASeparateClass) {
  const std::array<std::vector<CornerError>, 2> runs{errors(1.0, 0.0), errors(0.7, 0.6, 15)};
  const CornerScatter found = corner_scatter(runs);
  EXPECT_NEAR(found.wide.passing.trace() / 8, 1.0, 0.05);
  EXPECT_LT(found.wide.lasting.trace() / 8, 0.02);
  EXPECT_NEAR(found.narrow.passing.trace() / 8, 0.49, 0.05);
  EXPECT_NEAR(found.narrow.lasting.trace() / 8, 0.36, 0.05);
}

TEST(CornerScatter, ExcludesMisreadTags) {
  std::vector<CornerError> some = errors(1.0, 0.0);
  some[5].off_px.setConstant(30);
  EXPECT_NEAR(scatter_of(some).rms_px, kSigma_px, 0.003);
}

}  // namespace
}  // namespace fiducap
