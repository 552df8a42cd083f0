#pragma once

namespace fiducap {

/// The value that a chi-square variable with `degrees` degrees of freedom stays below with this
/// probability.
[[nodiscard]] double chi_square_quantile(int degrees, double probability);

}  // namespace fiducap
