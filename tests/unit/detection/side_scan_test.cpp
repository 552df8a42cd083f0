#include "detection/side_scan.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace fiducap {
namespace {

struct Grays {
  double bits, black, white, wall;
};

/// Profile of an edge `off` cells outside of the assumed position, by summing over the blur.
SideProfile profile(const Grays& grays, double off, double blur, double noise = 0) {
  constexpr int kPlaces = 2000;
  std::mt19937 random(7);
  std::normal_distribution<double> gauss(0, 1);
  SideProfile out{};
  for (std::size_t j = 0; j < out.size(); ++j) {
    const double t = -1 + 2.0 * static_cast<double>(j) / static_cast<double>(out.size() - 1);
    for (int k = 0; k < kPlaces; ++k) {
      const double x = t + blur * ((k + 0.5) / kPlaces - 0.5) - off;
      const double gray = x < -1  ? grays.bits
                          : x < 0 ? grays.black
                          : x < 1 ? grays.white
                                  : grays.wall;
      out[j] += gray / kPlaces;
    }
    out[j] += noise * gauss(random);
  }
  return out;
}

TEST(BlurredEdge, IsFoundForAllNeighboursAndBlurLengths) {
  constexpr double kExact = 0.03;  // cells: blurred over 1.8, 0.025; below 1.5 at most 0.01
  for (const double blur : {0.6, 0.9, 1.2, 1.5, 1.8}) {
    for (const double off : {-0.15, 0.0, 0.1}) {
      for (const Grays& grays : {Grays{120, 30, 210, 90}, {210, 30, 210, 210}, {30, 30, 210, 20}}) {
        const auto found = find_blurred_edge(profile(grays, off, blur), 0.8);
        ASSERT_TRUE(found) << blur << ' ' << off << ' ' << grays.bits;
        EXPECT_NEAR(found->offset, off, kExact) << blur << ' ' << grays.bits;
      }
    }
  }
}

TEST(BlurredEdge, IsFoundFromFurtherOffWhenBlackAndWhiteAreKnown) {
  constexpr double kNear = 0.05;  // cells: side_fit repeats the fit from there
  for (const double blur : {0.6, 0.9, 1.2, 1.5, 1.8}) {
    for (const double off : {-0.5, -0.3, 0.3, 0.5}) {
      for (const Grays& grays : {Grays{120, 30, 210, 90}, {210, 30, 210, 210}, {30, 30, 210, 20}}) {
        const TagLevels levels{grays.black + 2, grays.white - 4};
        const auto found = find_blurred_edge(profile(grays, off, blur), 0.6, levels);
        ASSERT_TRUE(found) << blur << ' ' << off << ' ' << grays.bits;
        EXPECT_NEAR(found->offset, off, kNear) << blur << ' ' << grays.bits;
        EXPECT_NEAR(found->blur, blur, 0.15);
      }
    }
  }
}

TEST(BlurredEdge, IsFoundInNoise) {
  constexpr double kNoise = 1.0;  // 3 in an image, mean of twelve profiles
  constexpr double kOff = 0.05;   // the steepest point is off by 0.06
  const auto found = find_blurred_edge(profile({120, 30, 210, 90}, 0.1, 1.2, kNoise), 0.8);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->offset, 0.1, kOff);
}

TEST(BlurredEdge, IsNotFoundInOtherProfiles) {
  SideProfile flat{};
  flat.fill(80);
  EXPECT_FALSE(find_blurred_edge(flat, 1.0));
  EXPECT_FALSE(find_blurred_edge(profile({90, 210, 30, 120}, 0, 1.2), 1.0)) << "inside out";
  SideProfile rough{};
  for (std::size_t j = 0; j < rough.size(); ++j) rough[j] = j % 2 == 0 ? 20 : 220;
  EXPECT_FALSE(find_blurred_edge(rough, 1.0));
  flat.fill(std::nan(""));
  EXPECT_FALSE(find_blurred_edge(flat, 1.0));
}

}  // namespace
}  // namespace fiducap
