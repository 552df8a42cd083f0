#include "estimation/filter/chi_square.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

namespace fiducap {

double chi_square_quantile(int degrees, double probability) {
  return boost::math::quantile(boost::math::chi_squared(degrees), probability);
}

double normal_score(double sigmas, double skewness) {
  constexpr double kNormal = 1e-3;
  if (!(skewness > kNormal)) return sigmas;
  const double degrees = 8 / (skewness * skewness);
  const double spread = 2 / (9 * degrees);
  const double over_mean = std::max(0.0, 1 + sigmas * std::sqrt(2 / degrees));
  return (std::cbrt(over_mean) - 1 + spread) / std::sqrt(spread);
}

}  // namespace fiducap
