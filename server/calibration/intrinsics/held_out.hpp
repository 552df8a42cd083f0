#pragma once

#include "calibration/intrinsics/lens_fit.hpp"

namespace fiducap {

/// Whether a lens says something about images that it was not fitted to.
struct HeldOut {
  bool tried{false};  ///< False: too few images to spare any.
  /// Every second image judged by the lens of the others, poses alone fitted; noise per coordinate,
  /// over that of the lens of all images there. 1: nothing was learned by heart.
  double ratio{1};
  /// Lenses of the first and the second half of the recording: focal lengths, 1-sigma of each.
  double first_focal{}, first_sigma{};
  double second_focal{}, second_sigma{};

  /// The focal length of the second half over that of the first.
  [[nodiscard]] double focal_step() const { return second_focal / first_focal; }
  /// The step in its own sigma.
  [[nodiscard]] double focal_step_sigma() const;
};

[[nodiscard]] HeldOut hold_out(const LensFit& fit);

}  // namespace fiducap
