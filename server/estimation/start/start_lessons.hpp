#pragma once

#include <vector>

#include "estimation/found_mismatch.hpp"
#include "estimation/start/learned_noise.hpp"

namespace fiducap {

/// A number of the configuration that was found to be wrong.
struct WrongNumber {
  FoundMismatch::Kind kind{};
  int camera{-1};
};

/// What a filter has learned in a start of its sensors and of the configuration: to begin another
/// one with, that follows the same start again.
struct StartLessons {
  LearnedNoise sensors;
  std::vector<double> corners_px;  ///< CornerNoise::unexplained_px of each camera.
  /// Lenses and readouts. A filter that believed in them once more, with corners called as noisy as
  /// they looked by the wrong ones, would not find them again. Sizes of prints are accused anew:
  /// until a lens was found, they were accused of what it did.
  std::vector<WrongNumber> wrong;
};

}  // namespace fiducap
