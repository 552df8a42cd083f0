#pragma once

namespace fiducap {

/// The value that a chi-square variable with `degrees` degrees of freedom stays below with this
/// probability.
[[nodiscard]] double chi_square_quantile(int degrees, double probability);

/// A sum of squares, in sigmas from its mean, with this skewness (above 0): where a normal variable
/// is as rare. As a gamma variable with these moments (E. B. Wilson, M. M. Hilferty, PNAS 17,
/// 1931).
[[nodiscard]] double normal_score(double sigmas, double skewness);

}  // namespace fiducap
