#pragma once

#include <vector>

#include "detection/corner_projection.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// What the corners of one tag in one image were off.
struct CornerError {
  Instant at{};
  int tag_id{};
  Vector8d off_px{Vector8d::Zero()};  ///< Seen − true, raw pixels.
  double sigma_px{};                  ///< What the detector says of it; 0: nothing.
};

/// Of all sightings of tags whose place is known, in order of time; true extrinsics, true lens.
[[nodiscard]] std::vector<CornerError> corner_errors(const EstimationData& data);

/// How corners scatter in truth. Misread tags (off by more than a pixel and ten sigmas) are not in
/// it.
struct CornerScatter {
  double rms_px{};      ///< Of a coordinate.
  double chi_square{};  ///< Of a coordinate, by the detector's sigma; NaN where it says none.
  /// Correlation of a coordinate with the same one in the next image: 0 is white noise, 1 an error
  /// that stays.
  double lasting{};
  /// The same of errors in sigmas: those of good corners, which tell most, count like all others.
  double lasting_in_sigmas{};
  int sightings{};

  /// What to multiply the detector's sigma by.
  [[nodiscard]] double excess() const;
  /// The same for corners whose errors are white and, over many images, average out as slowly as
  /// those that last do (first-order Markov): by √((1 + ρ) / (1 − ρ)) more.
  [[nodiscard]] double lasting_excess() const;
};
[[nodiscard]] CornerScatter corner_scatter(const std::vector<CornerError>& errors);

}  // namespace fiducap
