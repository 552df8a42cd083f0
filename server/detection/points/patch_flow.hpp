#pragma once

#include <optional>

#include <Eigen/Core>

#include "detection/points/image_pyramid.hpp"

namespace fiducap {

/// Where the surroundings of a point in one image are in another: Lucas and Kanade's flow in its
/// inverse form (S. Baker, I. Matthews, "Lucas-Kanade 20 years on", IJCV 2004), shift only, from
/// coarse to fine, blind to a change of brightness. Own although a library has it: OpenCV's
/// allocates derivatives for each call and starts threads.
namespace patch_flow {

inline constexpr int kHalf =
    6;  ///< Pixels from the middle of a patch to its border, at every level.
inline constexpr int kSide = 2 * kHalf + 1;

/// @param px     in `from`, raw pixels
/// @param guess  in `to`: within some ten pixels of the truth
/// @return nullopt: too near the border, without structure, or not found
[[nodiscard]] std::optional<Eigen::Vector2d> follow(const ImagePyramid& from,
                                                    const Eigen::Vector2d& px,
                                                    const ImagePyramid& to,
                                                    const Eigen::Vector2d& guess);

/// Least eigenvalue of the mean of g gᵀ over a patch (grays² / px²) from which on its place is
/// worth something: at three grays of noise about a tenth of a pixel.
inline constexpr float kLeastStructure = 9.0F;

}  // namespace patch_flow

}  // namespace fiducap
