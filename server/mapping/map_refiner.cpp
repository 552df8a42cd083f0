#include "mapping/map_refiner.hpp"

#include <utility>

namespace fiducap {

namespace {

/// The map with the surveyed tags that it does not have.
TagMap with(TagMap map, std::span<const KnownTag> surveyed) {
  for (const KnownTag& tag : surveyed)
    if (map.find(tag.tag_id) == nullptr) map.insert({tag, TagState::kSurveyed});
  return map;
}

}  // namespace

MapRefiner::MapRefiner(MapBuilder& map, std::span<const KnownTag> surveyed)
    : map_(map), graph_(with(*map.snapshot(), surveyed)) {}

void MapRefiner::replace_body(int body_id, std::vector<MotionSegment> segments) {
  graph_.replace_body(body_id, std::move(segments));
  is_settled_ = false;
}

void MapRefiner::take() {
  auto [segments, replacement, moves, contributions] = map_.take_segments();
  if (replacement != nullptr) {
    graph_ = MapGraph(*replacement);
    if (keeps_all_) keep_all();
    solution_.reset();
    findings_.clear();
    is_settled_ = true;
  }
  for (const EpochOrder& order : moves) graph_.follow(order);
  is_settled_ &= moves.empty();
  for (const auto& [body_id, segment] : segments) {
    MotionSegment own = *segment;
    own.body_id = body_id;
    is_settled_ &= !graph_.add(std::move(own));
  }
  contributions_ = contributions;
}

bool MapRefiner::solve(const std::stop_token& stop) {
  take();
  return solve_taken(stop);
}

bool MapRefiner::solve_taken(const std::stop_token& stop) {
  if (is_settled_) return false;
  taken_ = contributions_;
  solution_ = graph_.solve(stop);
  is_settled_ = solution_.has_value();
  if (solution_) {
    findings_ = solution_->findings;
    solution_->least_sightings = least_sightings_;
  }
  return is_settled_;
}

bool MapRefiner::establish_workspace() {
  const bool is_new = graph_.establish_workspace();
  if (is_new) is_settled_ = false;
  return is_new;
}

std::optional<RefinementTurn> MapRefiner::adopt(std::int64_t utc_now_ns) {
  const auto taken = std::exchange(taken_, std::nullopt);
  auto solution = std::exchange(solution_, std::nullopt);
  if (!taken) return std::nullopt;
  RefinementTurn turn{.taken = *taken};
  if (solution) turn.adopted = map_.adopt(std::move(*solution), utc_now_ns);
  return turn;
}

}  // namespace fiducap
