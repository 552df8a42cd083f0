#include "mapping/map_refiner.hpp"

#include <utility>

namespace fiducap {

bool MapRefiner::solve() {
  auto [segments, taken] = map_.take_segments();
  bool is_news = false;
  for (MotionSegment& segment : segments) is_news |= graph_.add(std::move(segment));
  if (!is_news) return false;
  taken_ = taken;
  solution_ = graph_.solve();
  return true;
}

std::optional<RefinementTurn> MapRefiner::adopt(std::int64_t utc_now_ns) {
  const auto solution = std::exchange(solution_, std::nullopt);
  if (!solution) return std::nullopt;
  return RefinementTurn{taken_, map_.adopt(*solution, utc_now_ns)};
}

}  // namespace fiducap
