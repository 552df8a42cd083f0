#pragma once

#include <span>
#include <vector>

#include "detection/tag_detector.hpp"
#include "detection/tracking/expected_tag.hpp"

namespace fiducap {

/// A part of the image that is searched in one call.
struct SearchRegion {
  ImageRegion pixels;
  int decimate{1};

  /// In pixels of full resolution: what the library does is proportional to the pixels in which it
  /// looks for quads.
  [[nodiscard]] double cost() const;
};

struct RegionRules {
  double outer_ring{0.125};  ///< Of the family, see TagDetector.
  double sigmas{3.0};        ///< How far off its prediction a tag may be.
  /// A tag is looked for in every n-th pixel as long as this many are left between its sides; its
  /// corners are fitted in all of them (`side_fit`). Measured on rendered images: from 13 on none
  /// is missed.
  double decimated_width_px{16};
  int max_decimate{4};
};

/// Regions that hold every expected tag whole, with room around it for its uncertainty, its quiet
/// zone and the border that TagDetector refuses. Aligned to the library's tiles, so that it sees
/// the same pixels as in the whole image. Two are joined when one call over both costs less than
/// two calls. Tags outside of the image are passed over.
/// @param out  replaced
void plan_regions(std::span<const ExpectedTag> expected, int width, int height,
                  const RegionRules& rules, std::vector<SearchRegion>& out);

}  // namespace fiducap
