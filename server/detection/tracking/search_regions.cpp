#include "detection/tracking/search_regions.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "detection/tag_outline.hpp"

namespace fiducap {

namespace {

constexpr int kTile_px = 4;
// TagDetector refuses tags closer than 5 px to the border; the rest is for a line fit that starts
// outside.
constexpr double kBorder_px = 8.0;
// What a call costs by itself, measured: about 15 µs.
constexpr double kCall_px = 400.0;

struct Extent {
  Eigen::Vector2d low, high;
};

Extent extent_of(const ExpectedTag& tag) {
  Extent e{tag.corners_px[0], tag.corners_px[0]};
  for (const Eigen::Vector2d& px : tag.corners_px) {
    e.low = e.low.cwiseMin(px);
    e.high = e.high.cwiseMax(px);
  }
  return e;
}

/// To the library's tiles: outwards, but not out of the image.
ImageRegion aligned(const Eigen::Vector2d& low, const Eigen::Vector2d& high, int step, int width,
                    int height) {
  const auto inside = [](double v, int most) {
    return static_cast<int>(std::clamp(v, 0.0, double(most)));
  };
  const auto up = [&](int v, int most) { return std::min((v + step - 1) / step * step, most); };
  return {inside(std::floor(low.x()), width) / step * step,
          inside(std::floor(low.y()), height) / step * step,
          up(inside(std::ceil(high.x()) + 1, width), width),
          up(inside(std::ceil(high.y()) + 1, height), height)};
}

std::optional<SearchRegion> region_of(const ExpectedTag& tag, int width, int height,
                                      const RegionRules& rules) {
  const bool finite = std::all_of(tag.corners_px.begin(), tag.corners_px.end(),
                                  [](const Eigen::Vector2d& px) { return px.allFinite(); });
  if (!finite || !std::isfinite(tag.sigma_px)) return std::nullopt;
  const Extent e = extent_of(tag);
  const TagOutline outline = outline_of(tag.corners_px);
  const double away = rules.sigmas * tag.sigma_px;
  const Eigen::Vector2d last(width - 1, height - 1);
  if ((e.low.array() < -away).any() || (e.high.array() > last.array() + away).any())
    return std::nullopt;
  const double margin = away + rules.outer_ring * outline.longest_px + kBorder_px;
  SearchRegion region;
  region.decimate = static_cast<int>(std::clamp(
      std::floor(outline.width_px / rules.decimated_width_px), 1.0, double(rules.max_decimate)));
  region.pixels = aligned(e.low.array() - margin, e.high.array() + margin,
                          kTile_px * region.decimate, width, height);
  return region;
}

/// As fine as the finer one, on the tiles of that.
SearchRegion joined(const SearchRegion& a, const SearchRegion& b, int width, int height) {
  SearchRegion both;
  both.decimate = std::min(a.decimate, b.decimate);
  const Eigen::Vector2d low(std::min(a.pixels.left, b.pixels.left),
                            std::min(a.pixels.top, b.pixels.top));
  const Eigen::Vector2d high(std::max(a.pixels.right, b.pixels.right) - 1,
                             std::max(a.pixels.bottom, b.pixels.bottom) - 1);
  both.pixels = aligned(low, high, kTile_px * both.decimate, width, height);
  return both;
}

/// Joins region i with any other that pays. @return true when it has grown
bool grow(std::vector<SearchRegion>& regions, std::size_t i, int width, int height) {
  for (std::size_t j = 0; j < regions.size(); ++j) {
    if (j == i) continue;
    const SearchRegion both = joined(regions[i], regions[j], width, height);
    if (both.cost() > regions[i].cost() + regions[j].cost()) continue;
    regions[std::min(i, j)] = both;
    regions[std::max(i, j)] = regions.back();
    regions.pop_back();
    return true;
  }
  return false;
}

}  // namespace

double SearchRegion::cost() const {
  return double(pixels.width()) * pixels.height() / (decimate * decimate) + kCall_px;
}

void plan_regions(std::span<const ExpectedTag> expected, int width, int height,
                  const RegionRules& rules, std::vector<SearchRegion>& out) {
  out.clear();
  for (const ExpectedTag& tag : expected) {
    if (const auto region = region_of(tag, width, height, rules)) out.push_back(*region);
  }
  for (std::size_t i = 0; i < out.size();) {
    if (grow(out, i, width, height)) {
      i = 0;
    } else {
      ++i;
    }
  }
}

}  // namespace fiducap
