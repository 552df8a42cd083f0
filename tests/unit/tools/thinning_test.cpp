#include "tools/plot/thinning.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace fiducap {
namespace {

TEST(Thinning, KeepsTheOnePeakOfALongLine) {
  std::vector<SvgPoint> points;
  for (int i = 0; i < 200'000; ++i)
    points.emplace_back(i * 0.003, i == 123'457 ? 5.0 : 100 + 0.1 * std::sin(i));
  const auto kept = thinned(points);
  EXPECT_LT(kept.size(), 4 * 601u);
  EXPECT_EQ(std::min_element(kept.begin(), kept.end(),
                             [](const auto& a, const auto& b) { return a.second < b.second; })
                ->second,
            5.0);
  EXPECT_EQ(kept.front(), points.front());
  EXPECT_EQ(kept.back(), points.back());
}

TEST(Thinning, LeavesOutWhatLiesOnTheLine) {
  EXPECT_EQ(thinned(std::vector<SvgPoint>{{0, 0}, {1, 1}, {2, 2}, {3, 0}}).size(), 3u);
}

TEST(Thinning, ARobotAtRestIsAFewPoints) {
  EXPECT_LE(thinned(std::vector<SvgPoint>(100'000, {4, 5})).size(), 2u);
}

TEST(Thinning, AnAreaStaysAsHighAndAsLowAsItIs) {
  std::vector<SvgSlice> slices;
  for (int i = 0; i < 100'000; ++i)
    slices.push_back({i * 0.006, i == 54'321 ? 1.0 : 40.0, i == 12'345 ? 90.0 : 60.0});
  const auto kept = thinned(slices);
  EXPECT_LE(kept.size(), 601u);
  double top = 100;
  double bottom = 0;
  for (const SvgSlice& slice : kept) {
    top = std::min(top, slice.top);
    bottom = std::max(bottom, slice.bottom);
  }
  EXPECT_EQ(top, 1.0);
  EXPECT_EQ(bottom, 90.0);
}

}  // namespace
}  // namespace fiducap
