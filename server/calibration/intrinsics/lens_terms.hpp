#pragma once

#include "calibration/intrinsics/lens_fit.hpp"

namespace fiducap {

/// Keeps the terms of distortion that the images support. The third radial coefficient of a
/// radial-tangential lens is freed where it is plain; where the images do not
/// determine the lens, others are held at zero again when the images are explained as well without
/// them, or when only without them the result can be a lens (can_be_a_lens): high orders that
/// nothing determines fit the corners and fold the rest.
[[nodiscard]] LensFit with_supported_terms(LensFit fit);

}  // namespace fiducap
