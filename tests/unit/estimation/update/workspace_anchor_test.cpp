#include "estimation/update/workspace_anchor.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace fiducap {
namespace {

TEST(PrintBend, TurnsTheBodyAboutThePrint) {
  const Matrix6d P = bend_of_print({4, 0, 0});
  EXPECT_NEAR(P(0, 0), 0, 1e-15) << "along the line to the print";
  EXPECT_NEAR(std::sqrt(P(1, 1)), 4 * 0.003, 1e-12);
  EXPECT_NEAR(std::sqrt(P(5, 5)), 0.003, 1e-12);
  // A turn to the left (about z) moves a body that is ahead (along x) to the left (along y).
  EXPECT_NEAR(P(1, 5), 4 * 0.003 * 0.003, 1e-12);
}

}  // namespace
}  // namespace fiducap
