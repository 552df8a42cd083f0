#include "detection/smeared_side.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace fiducap {
namespace {

struct Grays {
  double bits, black, white, wall;
};

/// Pictures of an edge `off` modules outside of where it was thought to be, by adding up places.
SideProfile profile(const Grays& grays, double off, double smear, double noise = 0) {
  constexpr int kPlaces = 2000;
  std::mt19937 random(7);
  std::normal_distribution<double> gauss(0, 1);
  SideProfile out{};
  for (std::size_t j = 0; j < out.size(); ++j) {
    const double t = -1 + 2.0 * static_cast<double>(j) / static_cast<double>(out.size() - 1);
    for (int k = 0; k < kPlaces; ++k) {
      const double x = t + smear * ((k + 0.5) / kPlaces - 0.5) - off;
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

TEST(SmearedSide, IsFoundWhateverLiesBesideItAndHoweverFarItIsSmeared) {
  constexpr double kExact = 0.03;  // modules: smeared over 1.8, 0.025; below 1.5 no more than 0.01
  for (const double smear : {0.6, 0.9, 1.2, 1.5, 1.8}) {
    for (const double off : {-0.15, 0.0, 0.1}) {
      for (const Grays& grays : {Grays{120, 30, 210, 90}, {210, 30, 210, 210}, {30, 30, 210, 20}}) {
        const auto found = find_smeared_side(profile(grays, off, smear), 0.8);
        ASSERT_TRUE(found) << smear << ' ' << off << ' ' << grays.bits;
        EXPECT_NEAR(found->off, off, kExact) << smear << ' ' << grays.bits;
      }
    }
  }
}

TEST(SmearedSide, IsFoundFromFurtherOffWhereBlackAndWhiteAreKnown) {
  constexpr double kNear = 0.05;  // modules: side_fit looks again from there
  for (const double smear : {0.6, 0.9, 1.2, 1.5, 1.8}) {
    for (const double off : {-0.5, -0.3, 0.3, 0.5}) {
      for (const Grays& grays : {Grays{120, 30, 210, 90}, {210, 30, 210, 210}, {30, 30, 210, 20}}) {
        const TagLevels levels{grays.black + 2, grays.white - 4};
        const auto found = find_smeared_side(profile(grays, off, smear), 0.6, levels);
        ASSERT_TRUE(found) << smear << ' ' << off << ' ' << grays.bits;
        EXPECT_NEAR(found->off, off, kNear) << smear << ' ' << grays.bits;
        EXPECT_NEAR(found->smear, smear, 0.15);
      }
    }
  }
}

TEST(SmearedSide, IsFoundInNoise) {
  constexpr double kNoise = 1.0;  // 3 in an image, over twelve places
  constexpr double kOff = 0.05;   // what the steepest place is off there: 0.06
  const auto found = find_smeared_side(profile({120, 30, 210, 90}, 0.1, 1.2, kNoise), 0.8);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->off, 0.1, kOff);
}

TEST(SmearedSide, IsNotFoundWhereGraySaysSomethingElse) {
  SideProfile flat{};
  flat.fill(80);
  EXPECT_FALSE(find_smeared_side(flat, 1.0));
  EXPECT_FALSE(find_smeared_side(profile({90, 210, 30, 120}, 0, 1.2), 1.0)) << "inside out";
  SideProfile rough{};
  for (std::size_t j = 0; j < rough.size(); ++j) rough[j] = j % 2 == 0 ? 20 : 220;
  EXPECT_FALSE(find_smeared_side(rough, 1.0));
  flat.fill(std::nan(""));
  EXPECT_FALSE(find_smeared_side(flat, 1.0));
}

}  // namespace
}  // namespace fiducap
