#pragma once

#include "estimation/lens_estimate.hpp"

namespace fiducap {

/// Something that is not as the configuration says, as a filter found it. It reckons with it.
struct FoundMismatch {
  enum class Kind {
    kFocalLength,  ///< `value`: relative; 0.01: the lens is 1 % longer.
    kCentreU,      ///< Principal point, px to the right …
    kCentreV,      ///< … and down.
    kDistortion,   ///< `value`: its first coefficient is so much larger.
    kLens,         ///< Not doubted but refined: `lens` is what came out. `value`: its focal length.
    kReadout,      ///< Rolling shutter, first row to last, s; as configured: 0.
    kAllPrints,    ///< All tags are so much larger, relative …
    kOnePrint,     ///< … or this one, beyond what all are.
    kImuNoise,     ///< Densities are so many times the declared ones.
    kGyroRange,    ///< Rates stood at one number, rad/s, and were not believed …
    kAccelRange,   ///< … or forces, m/s².
    kStampJitter,  ///< Each image's stamp is off on its own, 1-sigma, s.
  } kind{};
  int camera{-1};
  int tag_id{-1};
  double value{};
  double sigma{};
  LensEstimate lens{};
};

}  // namespace fiducap
