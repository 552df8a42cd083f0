#include "tools/plot/thinning.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace fiducap {
namespace {

constexpr double kTolerance_px = 0.25;
constexpr std::size_t kFew = 1000;  // points that are drawn as they are

/// First, lowest, highest and last point of each run within a pixel column.
std::vector<SvgPoint> extremes_of_columns(const std::vector<SvgPoint>& points) {
  std::vector<SvgPoint> out;
  for (std::size_t begin = 0, end = 0; begin < points.size(); begin = end) {
    std::size_t low = begin;
    std::size_t high = begin;
    const double column = std::floor(points[begin].first);
    for (end = begin; end < points.size() && std::floor(points[end].first) == column; ++end) {
      if (points[end].second < points[low].second) low = end;
      if (points[end].second > points[high].second) high = end;
    }
    std::array<std::size_t, 4> kept{begin, low, high, end - 1};
    std::sort(kept.begin(), kept.end());
    const auto last = std::unique(kept.begin(), kept.end());
    for (auto i = kept.begin(); i != last; ++i) out.push_back(points[*i]);
  }
  return out;
}

/// The point between two that is farthest from the line through them.
/// @return `first` when none is far
std::size_t farthest(const std::vector<SvgPoint>& points, std::size_t first, std::size_t last) {
  const auto [ax, ay] = points[first];
  const double dx = points[last].first - ax;
  const double dy = points[last].second - ay;
  const double length = std::hypot(dx, dy);
  double most = kTolerance_px;
  std::size_t split = first;
  for (std::size_t i = first + 1; i < last; ++i) {
    const double px = points[i].first - ax;
    const double py = points[i].second - ay;
    // A line that comes back to its start has no direction.
    const double off = length > 0 ? std::abs(px * dy - py * dx) / length : std::hypot(px, py);
    if (off <= most) continue;
    most = off;
    split = i;
  }
  return split;
}

/// Without what lies where the last kept point does: a robot at rest, and the bound on what comes.
std::vector<SvgPoint> apart(const std::vector<SvgPoint>& points) {
  std::vector<SvgPoint> out;
  for (const SvgPoint& p : points) {
    const bool moved = out.empty() || &p == &points.back() ||
                       std::abs(p.first - out.back().first) > kTolerance_px ||
                       std::abs(p.second - out.back().second) > kTolerance_px;
    if (moved) out.push_back(p);
  }
  return out;
}

}  // namespace

std::vector<SvgPoint> thinned(const std::vector<SvgPoint>& all) {
  if (all.size() < 3) return all;
  std::vector<SvgPoint> points = all;
  if (points.size() > kFew) points = apart(extremes_of_columns(points));
  std::vector<bool> kept(points.size(), false);
  kept.front() = kept.back() = true;
  std::vector<std::pair<std::size_t, std::size_t>> open{{0, points.size() - 1}};
  while (!open.empty()) {
    const auto [first, last] = open.back();
    open.pop_back();
    const std::size_t split = farthest(points, first, last);
    if (split == first) continue;
    kept[split] = true;
    open.emplace_back(first, split);
    open.emplace_back(split, last);
  }
  std::vector<SvgPoint> out;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (kept[i]) out.push_back(points[i]);
  return out;
}

std::vector<SvgSlice> thinned(const std::vector<SvgSlice>& slices) {
  if (slices.size() <= kFew) return slices;
  std::vector<SvgSlice> out;
  for (const SvgSlice& slice : slices) {
    if (out.empty() || std::floor(slice.x) != std::floor(out.back().x)) {
      out.push_back(slice);
      continue;
    }
    out.back().top = std::min(out.back().top, slice.top);
    out.back().bottom = std::max(out.back().bottom, slice.bottom);
  }
  return out;
}

}  // namespace fiducap
