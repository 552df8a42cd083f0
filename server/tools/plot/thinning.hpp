#pragma once

#include <vector>

#include "tools/plot/svg_parts.hpp"

namespace fiducap {

/// What of a long line is drawn. Of every pixel column the first, lowest, highest and last point in
/// a row stay, so that no peak is hidden; after that goes what changes the line by less than a
/// quarter of a pixel (Ramer, Douglas, Peucker).
/// @param points  in pixels, finite
[[nodiscard]] std::vector<SvgPoint> thinned(const std::vector<SvgPoint>& points);

/// An area between two borders over one x.
struct SvgSlice {
  double x{};
  double top{};
  double bottom{};  ///< Below `top`, or at it.
};

/// One slice a pixel column, as high as the highest of its slices and as low as the lowest.
/// @param slices  in pixels, finite, x does not decrease
[[nodiscard]] std::vector<SvgSlice> thinned(const std::vector<SvgSlice>& slices);

}  // namespace fiducap
