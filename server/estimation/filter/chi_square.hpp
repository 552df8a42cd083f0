#pragma once

namespace fiducap {

/// Quantile of the chi-square distribution with `degrees` degrees of freedom.
[[nodiscard]] double chi_square_quantile(int degrees, double probability);

/// Normal score of a sum of squares: the value of a standard normal variable of equal probability.
/// Approximation for a gamma variable (E. B. Wilson, M. M. Hilferty, PNAS 17, 1931).
/// @param sigmas    distance from the mean
/// @param skewness  above 0
[[nodiscard]] double normal_score(double sigmas, double skewness);

}  // namespace fiducap
