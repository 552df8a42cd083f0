// Sums of squares as normal variables, against the exact distribution.
#include "estimation/filter/chi_square.hpp"

#include <gtest/gtest.h>

#include <boost/math/distributions/normal.hpp>
#include <cmath>

namespace fiducap {
namespace {

// The approximation itself is 0.13 short at 4 sigma of a sum of two, and better of all others.
TEST(NormalScore, HasTheProbabilityOfTheSumOfSquares) {
  for (const int degrees : {2, 4, 10, 100}) {
    for (const double sigmas : {-1.0, 0.0, 1.0, 2.0, 3.0, 4.0}) {
      const double probability = boost::math::cdf(boost::math::normal(), sigmas);
      const double value = chi_square_quantile(degrees, probability);
      EXPECT_NEAR(
          normal_score((value - degrees) / std::sqrt(2.0 * degrees), std::sqrt(8.0 / degrees)),
          sigmas, 0.13)
          << degrees << " degrees of freedom";
    }
  }
}

TEST(NormalScore, WithoutSkewnessIsTheScore) {
  EXPECT_EQ(normal_score(3.0, 0.0), 3.0);
  EXPECT_NEAR(normal_score(3.0, 2e-3), 3.0, 1e-2);
}

}  // namespace
}  // namespace fiducap
