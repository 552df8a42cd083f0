#include "mapping/map_refiner.hpp"

#include <utility>

namespace fiducap {

bool MapRefiner::solve(const std::stop_token& stop) {
  auto [segments, moves, taken] = map_.take_segments();
  for (const EpochOrder& order : moves) graph_.follow(order);
  is_settled_ &= moves.empty();
  for (const auto& [body_id, segment] : segments) {
    MotionSegment own = *segment;
    own.body_id = body_id;
    is_settled_ &= !graph_.add(std::move(own));
  }
  if (is_settled_) return false;
  taken_ = taken;
  solution_ = graph_.solve(stop);
  is_settled_ = solution_.has_value();
  return is_settled_;
}

std::optional<RefinementTurn> MapRefiner::adopt(std::int64_t utc_now_ns) {
  auto solution = std::exchange(solution_, std::nullopt);
  if (!solution) return std::nullopt;
  return RefinementTurn{taken_, map_.adopt(std::move(*solution), utc_now_ns)};
}

}  // namespace fiducap
