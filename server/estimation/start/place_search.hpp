#pragma once

#include <optional>
#include <span>

#include "estimation/start/resection.hpp"

namespace fiducap {

/// What is known beforehand about where the body stands in axes A.
struct PlaceGuess {
  Pose X_AB;
  double position_sigma_m{};
  double rotation_sigma_rad{};
};

/// Where the body stands, and how much worse the next different answer is.
struct PlaceFound {
  Pose X_AB;
  double evidence{};  ///< Chi-square by which the best answer beats the best clearly different one;
                      ///< ∞ when there is none.
  double misfit{};    ///< Chi-square of the best answer per degree of freedom …
  double surprise{};  ///< … and what the guess has in it.
};

/// Places turned against each other by less than this are the same answer.
inline constexpr double kSamePlace_rad = 0.05;

/// Finds the body from the tags of one image alone: each tag with each of its two planar poses
/// proposes a place, the one that explains all tags and the guess best wins. No linearisation, so
/// it holds after any gap.
/// @return nullopt when no tag proposes a possible place
[[nodiscard]] std::optional<PlaceFound> find_place(std::span<const SightedTag> tags,
                                                   const PlaceGuess& guess, double corner_noise_px,
                                                   double same_rad = kSamePlace_rad);

}  // namespace fiducap
