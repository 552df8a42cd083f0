#include "pipeline/replay/bodies_replay.hpp"

#include <algorithm>
#include <utility>

#include "base/pose.hpp"

namespace fiducap {
namespace {
// Live bodies publish while another one works on an image: no image has a map older than this.
constexpr std::size_t kRevisions = 256;
// Each continues from the one before, which stopped after forty steps.
constexpr int kMostRounds = 10;

std::vector<KnownTag> surveyed_by(const std::vector<ReplayedBody>& bodies) {
  std::vector<KnownTag> all;
  for (const ReplayedBody& body : bodies)
    all.insert(all.end(), body.setup.priors.begin(), body.setup.priors.end());
  return all;
}

}  // namespace

BodiesReplay::BodiesReplay(std::vector<ReplayedBody> bodies, const MapConfig& map, TagMap start)
    : map_(map, std::move(start)),
      refiner_(map_, surveyed_by(bodies)),
      refine_period_(from_seconds(map.refine_period_s)) {
  for (ReplayedBody& body : bodies) {
    body.setup.records_segments = true;
    auto pipeline = std::make_unique<BodyPipeline>(body.setup);
    bodies_.push_back({std::move(body), std::move(pipeline), false, {}});
  }
}

void BodiesReplay::follow(std::vector<MapTurn> turns,
                          std::optional<std::vector<RefinementTurn>> refinements) {
  turns_ = std::move(turns);
  if (refinements) refinements_.emplace(refinements->begin(), refinements->end());
}

Expected<void> BodiesReplay::run(const Watch& watch) {
  for (std::size_t body = 0; body < bodies_.size(); ++body)
    if (const auto done = advance(body); !done) return done;
  if (const auto done = run_by_turns(watch); !done) return done;
  while (const auto body = earliest()) {
    if (!turns_.empty()) ++turns_missed_;
    if (const auto done = take_next(*body, map_.view(bodies_[*body].id), watch); !done) return done;
  }
  return {};
}

/// Reads and processes until an image is next, or nothing is left.
Expected<void> BodiesReplay::advance(std::size_t index) {
  Body& body = bodies_[index];
  body.image_at.reset();
  for (;;) {
    while (body.pipeline->next() != nullptr) {
      if (body.pipeline->next_is_image()) {
        body.image_at = time_of(*body.pipeline->next()) + body.later;
        return {};
      }
      (void)body.pipeline->take({});
    }
    if (body.exhausted) {
      map_.release(body.id);
      return {};
    }
    auto sample = body.source->next({});
    if (!sample) return tl::unexpected(sample.error());
    if (!sample->has_value()) {
      body.exhausted = true;
      body.pipeline->finish();
      continue;
    }
    if (listener_) listener_(index, **sample);
    if (!body.pipeline->push(std::move(**sample)))
      return fail(
          ErrorCode::kInvalid,
          "too many IMU samples wait for an image; are the stamps of the sensors on one clock?",
          body.name);
  }
}

std::optional<std::size_t> BodiesReplay::earliest() const {
  std::optional<std::size_t> first;
  for (std::size_t body = 0; body < bodies_.size(); ++body) {
    if (!bodies_[body].image_at) continue;
    if (!first || *bodies_[body].image_at < *bodies_[*first].image_at) first = body;
  }
  return first;
}

Expected<void> BodiesReplay::take_next(std::size_t index, const MapView& view, const Watch& watch) {
  view_ = view;
  Body& body = bodies_[index];
  const BodyUpdate* update = body.pipeline->take(view);
  if (update != nullptr) {
    newest_ = std::max(newest_, update->seen.exposed_at);
    map_.absorb(contribution_of(view, *update), to_ns(newest_));
    refine(update->seen.exposed_at + body.later);
    last_ = update->is_placed() ? std::optional(update->estimate->X_WB) : std::nullopt;
    if (watch) watch(index, *update);
  }
  return advance(index);
}

void BodiesReplay::refine(Instant now) {
  if (refinements_) return;
  if (!began_at_) began_at_ = refined_at_ = now;
  const Duration seen = now - *began_at_;
  const Duration pause = std::max(refine_period_, from_seconds(refine_share_ * to_seconds(seen)));
  if (now - refined_at_ < pause) {
    if (refine_share_ > 0) refiner_.take();
    return;
  }
  refined_at_ = now;
  if (refiner_.solve()) (void)refiner_.adopt(to_ns(newest_));
}

BodiesReplay::LastRefinement BodiesReplay::refine_to_the_end(
    const std::function<void(int round)>& progress) {
  for (Body& body : bodies_) {
    while (const auto segment = body.pipeline->take_last_segment()) {
      map_.absorb({.body_id = body.id, .at = segment->end().at, .segment = segment},
                  to_ns(newest_));
      refiner_.take();
    }
  }
  return solve_to_rest(progress);
}

BodiesReplay::LastRefinement BodiesReplay::solve_to_rest(
    const std::function<void(int round)>& progress) {
  LastRefinement last;
  // With given tags, the workspace is what is connected to them.
  if (map_.snapshot()->tags.empty()) last.has_found_workspace = refiner_.establish_workspace();
  for (int round = 1; round <= kMostRounds; ++round) {
    if (progress) progress(round);
    const bool is_solved = refiner_.solve();
    const auto turn = refiner_.adopt(to_ns(newest_));
    last.is_at_rest = is_solved || !turn;
    if (last.is_at_rest) break;
  }
  return last;
}

/// Refinements of the recorded session before this turn. Each is solved at the time it was taken,
/// because the state of the graph initialises its segments.
void BodiesReplay::refine_as_before(std::uint64_t turn) {
  while (refinements_ && !refinements_->empty()) {
    const RefinementTurn& next = refinements_->front();
    if (next.taken > turn) return;
    if (!is_solved_) is_solved_ = refiner_.solve();
    if (next.adopted && *next.adopted > turn) return;
    if (*is_solved_ != next.adopted.has_value()) ++turns_missed_;
    if (next.adopted) {
      remember(map_.published());
      (void)refiner_.adopt(0);
    }
    is_solved_.reset();
    refinements_->pop_front();
  }
}

void BodiesReplay::remember(const MapView& view) {
  if (!published_.empty() && published_.back().revision == view.revision) return;
  published_.push_back(view);
  if (published_.size() > kRevisions) published_.pop_front();
}

bool BodiesReplay::is_at(const Body& body, const MapTurn& turn) {
  if (!body.image_at) return false;
  const SensorSample& image = *body.pipeline->next();
  return to_ns(time_of(image) - clock_shift_of(image)) == turn.stamp_ns;
}

/// First takes images whose turns were lost, with the present map.
Expected<void> BodiesReplay::skip_to(const MapTurn& turn, const Watch& watch) {
  Body& body = bodies_[turn.body];
  while (body.image_at) {
    const SensorSample& image = *body.pipeline->next();
    if (to_ns(time_of(image) - clock_shift_of(image)) >= turn.stamp_ns) return {};
    ++turns_missed_;
    if (const auto done = take_next(turn.body, map_.view(body.id), watch); !done) return done;
  }
  return {};
}

Expected<void> BodiesReplay::run_by_turns(const Watch& watch) {
  for (const MapTurn& turn : turns_) {
    refine_as_before(turn.turn);
    if (turn.body < bodies_.size()) {
      if (const auto done = skip_to(turn, watch); !done) return done;
    }
    if (turn.body >= bodies_.size() || !is_at(bodies_[turn.body], turn)) {
      ++turns_missed_;
      continue;
    }
    MapView now = map_.view(bodies_[turn.body].id);
    remember(now);
    const auto seen = std::ranges::find(published_, turn.revision, [](const MapView& view) {
      return static_cast<std::int64_t>(view.revision);
    });
    if (seen == published_.end()) ++turns_missed_;
    const MapView view{seen != published_.end() ? seen->map : now.map, turn.may_define_workspace,
                       now.revision, now.body_id};
    last_.reset();
    if (const auto done = take_next(turn.body, view, watch); !done) return done;
    compare(turn);
  }
  return {};
}

void BodiesReplay::compare(const MapTurn& turn) {
  if (!turn.X_WB && !last_) return;
  ++agreement_.compared;
  if (!turn.X_WB || !last_) {
    ++agreement_.different;
    return;
  }
  if (last_->p == turn.X_WB->p && last_->q.coeffs() == turn.X_WB->q.coeffs()) return;
  ++agreement_.different;
  agreement_.worst_m = std::max(agreement_.worst_m, (last_->p - turn.X_WB->p).norm());
  agreement_.worst_rad = std::max(agreement_.worst_rad, angle_between(last_->q, turn.X_WB->q));
}

}  // namespace fiducap
