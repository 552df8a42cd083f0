#include "estimation/filter/chi_square.hpp"

#include <boost/math/distributions/chi_squared.hpp>

namespace fiducap {

double chi_square_quantile(int degrees, double probability) {
  return boost::math::quantile(boost::math::chi_squared(degrees), probability);
}

}  // namespace fiducap
