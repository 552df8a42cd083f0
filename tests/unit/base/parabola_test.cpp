#include "base/parabola.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

TEST(Parabola, IsLowestAtItsVertexAtMostOneStepAway) {
  const auto values = [](double x) { return 3 * (x - 0.3) * (x - 0.3) + 2; };
  EXPECT_NEAR(lowest_of_parabola(values(-1), values(0), values(1)), 0.3, 1e-12);
  EXPECT_EQ(lowest_of_parabola(9, 5, 1.1), 1.0);
}

TEST(Parabola, ThatBendsTheOtherWayStaysInTheMiddle) {
  EXPECT_EQ(lowest_of_parabola(1, 2, 1), 0.0);
  EXPECT_EQ(lowest_of_parabola(1, 1, 1), 0.0);
}

}  // namespace
}  // namespace fiducap
