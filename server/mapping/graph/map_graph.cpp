#include "mapping/graph/map_graph.hpp"

#include <algorithm>
#include <cmath>

#include "base/so3.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/world/filter_state.hpp"
#include "mapping/graph/graph_components.hpp"
#include "mapping/graph/graph_doubts.hpp"
#include "mapping/graph/graph_path.hpp"
#include "mapping/graph/graph_terms.hpp"

namespace fiducap {

namespace {

constexpr int kMostIterations = 40;
constexpr double kLeastDamping = 1e-9;
constexpr double kMostDamping = 1.0;
// A step that makes the cost smaller by less than this moves nothing by more than a third of its
// sigma, and most of all much less.
constexpr double kConverged = 0.05;
constexpr double kBetweenLinearisations = 1.0;
// What is found to be wrong in one solution; the rest comes with the next one.
constexpr int kMostVerdicts = 8;
// A segment is linearised anew when something in it has moved, against where the body began, by
// more than this: turned, or by this share of its distance; or a camera on its body, or its clock.
// Segments that were linearised elsewhere seem to say more of a tag's heading than they do, and the
// more of them there are, the surer the graph is of that.
constexpr double kTurned_rad = 0.0003;
constexpr double kMoved = 0.0006;
constexpr double kCameraMoved_m = 0.0002;
constexpr double kGravityMoved_m_s2 = 1e-4;  // times tilts: microradians
constexpr double kClockShifted_s = 4e-5;
// … or a lens, or a print.
constexpr double kScaled = 0.002;
constexpr double kCentreMoved_px = 2.0;
constexpr double kBent = 0.01;
// A tag joins two components when it, seen from both, differs by no more than this in what gravity
// says.
constexpr double kSameTilt_rad = 0.06;
constexpr double kSamePlace_m = 0.15;

bool has_moved(const Pose& was, const Vector6d& by) {
  const double shifted = (world::moved(was, by).p - was.p).norm();
  return by.tail<3>().norm() > kTurned_rad || shifted > kMoved * (0.5 + was.p.norm());
}

/// @param error  against where it was linearised
bool is_elsewhere(const GraphSegment& segment, const Eigen::VectorXd& error) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const SegmentFactor& f = segment.factor;
  const int cameras = static_cast<int>(f.cameras.size());
  for (int c = 0; c < cameras; ++c) {
    const auto by = error.segment<kCameraSize>(camera(c));  // place, turn, clock, …
    if (by.head<3>().norm() > kCameraMoved_m || by.segment<3>(3).norm() > kTurned_rad ||
        std::abs(by(kClock)) > kClockShifted_s || std::abs(by(kReadout)) > 2 * kClockShifted_s ||
        std::abs(by(kFocal)) > kScaled || by.segment<2>(kCentre).norm() > kCentreMoved_px ||
        std::abs(by(kDistortion)) > kBent)
      return true;
  }
  const int gravity_at = gravity(cameras, static_cast<int>(f.tags.size()));
  if (segment.raw.has_imu() && std::abs(error(gravity_at)) > kGravityMoved_m_s2) return true;
  if (has_moved(f.end.X_WB, error.segment<6>(kEnd))) return true;
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    const auto number = static_cast<int>(i);
    if (has_moved(f.tags[i].X_WT, error.segment<6>(tag(cameras, number))) ||
        std::abs(error(scale(cameras, number))) > kScaled)
      return true;
  }
  return false;
}

}  // namespace

/// As it is now: with the clocks that it has since they have jumped last.
std::size_t MapGraph::body_of(const MotionSegment& segment) {
  auto& bodies = state_.bodies;
  const auto found = std::find_if(bodies.rbegin(), bodies.rend(), [&](const GraphBody& body) {
    return body.id == segment.body_id;
  });
  if (found == bodies.rend()) {
    bodies.push_back(body_by_configuration(segment.body_id, *segment.sensors));
    state_.doubts |= segment.sensors->doubts;
    if (segment.has_imu())
      state_.gravity_sigma_m_s2 =
          std::min(state_.gravity_sigma_m_s2, segment.sensors->gravity_sigma_m_s2);
    return bodies.size() - 1;
  }
  const std::size_t index = bodies.size() - 1 - static_cast<std::size_t>(found - bodies.rbegin());
  if (goes_on(segment) || !has_other_clocks(bodies[index], segment)) return index;
  bodies.push_back(with_other_clocks(bodies[index], static_cast<int>(index), segment));
  return bodies.size() - 1;
}

bool MapGraph::add(MotionSegment segment) {
  const std::size_t body = body_of(segment);
  const std::vector<int> epochs = epochs_.sort(segment);
  if (segment.tags.empty() && !goes_on(segment)) return false;
  GraphSegment entry;
  auto factor = condense(segment);
  if (!factor) return false;
  entry.factor = std::move(*factor);
  entry.begin = goes_on(segment) ? *chains_.at(segment.body_id).node
                                 : begin_chain(body, segment, is_in_workspace(segment, epochs));
  join_workspace(entry.begin, segment, epochs);
  const int component = state_.nodes[entry.begin].component;
  const Pose G =
      axes_between(segment.begin().X_WB, state_.nodes[entry.begin].at.X_WB, segment.has_imu());
  entry.end = state_.nodes.size();
  state_.nodes.push_back({static_cast<int>(body), in_other_axes(G, segment.end()), component});
  state_.nodes.back().at.at = segment.end().at;
  // The factor's tags stand in the factor's axes, the segment's in the filter's.
  entry.raw = std::move(segment);
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    const KnownTag& tag = entry.raw.tags[i];
    entry.tags.push_back(tag_of(component, tag, epochs[i], G * tag.X_WT, entry.raw.begin().at));
  }
  hold_reference(entry.raw, epochs, component);
  count_sightings(entry);
  chains_[entry.raw.body_id] = {entry.end, entry.raw.chain};
  state_.segments.push_back(std::move(entry));
  link_components(state_.segments.back(), component);
  return true;
}

/// It does not when a segment between is missing: nobody knows how the body got over there.
bool MapGraph::goes_on(const MotionSegment& segment) const {
  const auto chain = chains_.find(segment.body_id);
  return chain != chains_.end() && chain->second.node && chain->second.number == segment.chain &&
         state_.nodes[*chain->second.node].at.at == segment.begin().at;
}

std::size_t MapGraph::tag_of(int component, const KnownTag& tag, int epoch, const Pose& X_WT,
                             Instant now) {
  const auto found = std::find_if(state_.tags.begin(), state_.tags.end(), [&](const GraphTag& t) {
    return t.tag_id == tag.tag_id && t.component == component && t.epoch == epoch;
  });
  if (found != state_.tags.end()) return static_cast<std::size_t>(found - state_.tags.begin());
  GraphTag added{.tag_id = tag.tag_id,
                 .edge_m = tag.edge_m,
                 .X_WT = X_WT,
                 .component = component,
                 .first_seen = now,
                 .epoch = epoch,
                 .print = {}};
  // The same print as elsewhere, or as before it was moved.
  const auto same = std::find_if(state_.tags.rbegin(), state_.tags.rend(),
                                 [&](const GraphTag& t) { return t.tag_id == tag.tag_id; });
  if (same != state_.tags.rend()) {
    added.scale = same->scale;
    added.print = same->print;
  }
  state_.tags.push_back(added);
  return state_.tags.size() - 1;
}

std::size_t MapGraph::begin_chain(std::size_t body, const MotionSegment& segment,
                                  bool is_in_workspace) {
  const int component = is_in_workspace ? kInWorkspace : ++components_;
  state_.level[component] =
      state_.level[component] || segment.has_imu() || segment.up_B.has_value();
  const auto last = chains_.find(segment.body_id);
  ChainStart start{.node = state_.nodes.size(), .has_imu = segment.has_imu()};
  start.up_B = segment.up_B;
  if (last != chains_.end() && last->second.node && segment.has_imu()) {
    start.after = static_cast<int>(*last->second.node);
    const InertialInput& input = segment.instances[1].steps.front().input;
    start.accel_walk = std::max(1e-6, input.accel_walk);
    start.gyro_walk = std::max(1e-7, input.gyro_walk);
  }
  if (last == chains_.end()) begin_with(segment.cameras, state_.bodies[body]);
  state_.nodes.push_back({static_cast<int>(body), segment.begin(), component});
  state_.starts.push_back(start);
  return start.node;
}

/// A body says that it stands in the workspace, and what it sees hangs on it. Nothing may be in a
/// component that no sighting binds to the rest.
bool MapGraph::is_in_workspace(const MotionSegment& segment, const std::vector<int>& epochs) const {
  if (!segment.anchored) return false;
  const auto is_there = [](const auto& x) { return x.component == kInWorkspace; };
  if (std::none_of(state_.nodes.begin(), state_.nodes.end(), is_there) &&
      std::none_of(state_.tags.begin(), state_.tags.end(), is_there))
    return true;
  return std::any_of(state_.tags.begin(), state_.tags.end(), [&](const GraphTag& tag) {
    for (std::size_t i = 0; i < epochs.size() && is_there(tag); ++i)
      if (segment.tags[i].tag_id == tag.tag_id && epochs[i] == tag.epoch) return true;
    return false;
  });
}

/// A body that began in axes of its own stands in the workspace since then.
void MapGraph::join_workspace(std::size_t begin, const MotionSegment& segment,
                              const std::vector<int>& epochs) {
  const GraphNode& node = state_.nodes[begin];
  if (node.component == kInWorkspace || !is_in_workspace(segment, epochs)) return;
  const bool level = state_.level.at(node.component);
  merge_components(node.component, kInWorkspace,
                   axes_between(node.at.X_WB, segment.begin().X_WB, level), state_);
}

void MapGraph::count_sightings(const GraphSegment& entry) {
  std::map<int, std::size_t> numbers;
  for (const std::size_t i : entry.tags) numbers[state_.tags[i].tag_id] = i;
  for (const MotionSegment::Instance& instance : entry.raw.instances) {
    for (const SegmentImage& image : instance.images) {
      for (const SegmentSighting& sighting : image.tags) {
        GraphTag& tag = state_.tags[numbers.at(sighting.seen.tag_id)];
        ++tag.sightings;
        tag.last_seen = instance.body.at;
      }
    }
  }
}

/// Tags of another component say how the two lie; when all of them say the same, they are one.
void MapGraph::link_components(const GraphSegment& entry, int component) {
  const Pose G =
      axes_between(entry.factor.begin.X_WB, state_.nodes[entry.begin].at.X_WB, entry.raw.has_imu());
  std::map<int, std::vector<Pose>> links;  // T: from this component to the other
  for (std::size_t i = 0; i < entry.tags.size(); ++i) {
    const Pose here = G * entry.factor.tags[i].X_WT;
    for (const GraphTag& tag : state_.tags) {
      if (tag.tag_id != entry.factor.tags[i].tag_id || tag.component == component ||
          tag.epoch != state_.tags[entry.tags[i]].epoch)
        continue;
      const bool level = state_.level.at(component) && state_.level.at(tag.component);
      const Pose T = axes_between(here, tag.X_WT, level);
      if (angle_between((T * here).q, tag.X_WT.q) < kSameTilt_rad)
        links[tag.component].push_back(T);
    }
  }
  const Eigen::Vector3d body = state_.nodes[entry.begin].at.X_WB.p;
  for (const auto& [other, all] : links) {
    const Eigen::Vector3d there = all.front() * body;
    const bool agree = std::all_of(all.begin(), all.end(), [&](const Pose& T) {
      return (T * body - there).norm() < kSamePlace_m;
    });
    if (!agree) continue;
    // The workspace stays where it is.
    if (component != kInWorkspace) {
      merge_components(component, other, all.front(), state_);
    } else {
      merge_components(other, component, all.front().inverse(), state_);
    }
    return;
  }
}

std::optional<GraphSolution> MapGraph::solve(const std::stop_token& stop) {
  if (state_.segments.empty() || state_.tags.empty()) return std::nullopt;
  GraphSolution done;
  for (const GraphSegment& segment : state_.segments) done.numbers += segment.factor.numbers;
  const auto covariance = settle(stop, done);
  if (stop.stop_requested()) return std::nullopt;
  if (covariance) {
    tell(*covariance, done);
    reference_tag_.reset();  // W has been told: it stays there
  }
  if (!keeps_all_) keep_bounded(covariance.has_value());
  return covariance ? std::optional(std::move(done)) : std::nullopt;
}

/// To where everything fits best, once what does not fit is known to be wrong.
std::optional<GraphCovariance> MapGraph::settle(const std::stop_token& stop, GraphSolution& done) {
  for (int verdicts = 0;; ++verdicts) {
    if (!iterate(stop, done)) return std::nullopt;
    lay_over_definition();
    auto covariance = this->covariance();
    if (!covariance || verdicts == kMostVerdicts || stop.stop_requested()) return covariance;
    const double dispersion = done.cost / std::max(1.0, done.numbers);
    if (!judge_doubts(*covariance, dispersion, state_)) return covariance;
  }
}

/// Levenberg–Marquardt until nothing moves. Segments are linearised anew on the way, where they
/// have moved: steps by old ones would lead past the truth, or towards it slowly.
/// @return whether it has come to rest
bool MapGraph::iterate(const std::stop_token& stop, GraphSolution& done) {
  const GraphVariables variables(state_);
  double damping = kLeastDamping;
  NormalEquations equations = normal_equations(state_, variables);
  for (done.iterations = 1; done.iterations <= kMostIterations; ++done.iterations) {
    if (stop.stop_requested()) return false;
    done.cost = 2 * equations.cost;
    const auto factor = BlockCholesky::factor(equations.H, damping);
    const Eigen::VectorXd delta =
        factor ? Eigen::VectorXd(factor->solve(equations.pull)) : Eigen::VectorXd();
    if (!factor || !delta.allFinite()) {
      damping *= 100;
      if (damping > kMostDamping) return false;
      continue;
    }
    const double gain = 0.5 * delta.dot(equations.pull);
    if (gain < kConverged) {
      // That is little for the whole; for a number that is held tightly it may not be.
      move_by(delta, variables, equations.H, state_);
      return true;
    }
    const auto nodes = state_.nodes;
    const auto tags = state_.tags;
    const auto bodies = state_.bodies;
    const double prints_scale = state_.prints_scale;
    const double gravity_offset_m_s2 = state_.gravity_offset_m_s2;
    move_by(delta, variables, equations.H, state_);
    const int again = condense_again(stop);
    if (stop.stop_requested()) return false;
    done.condensed += again;
    NormalEquations next = normal_equations(state_, variables);
    if (again > 0 || next.cost <= equations.cost) {
      damping = std::max(kLeastDamping, 0.1 * damping);
      equations = std::move(next);
      continue;
    }
    state_.nodes = nodes;
    state_.tags = tags;
    state_.bodies = bodies;
    state_.prints_scale = prints_scale;
    state_.gravity_offset_m_s2 = gravity_offset_m_s2;
    // No step is small enough to gain what little is promised: that is between linearisations.
    damping *= 100;
    if (damping > kMostDamping) return gain < kBetweenLinearisations;
  }
  return false;
}

int MapGraph::condense_again(const std::stop_token& stop) {
  int count = 0;
  for (GraphSegment& segment : state_.segments) {
    if (stop.stop_requested()) break;
    if (!is_elsewhere(segment, error_of(state_, segment))) continue;
    MotionSegment raw = segment_now(state_, segment);
    auto factor = condense(raw);
    if (!factor) continue;
    segment.raw = std::move(raw);
    segment.factor = std::move(*factor);
    ++count;
  }
  return count;
}

std::optional<GraphCovariance> MapGraph::covariance() const {
  std::vector<std::size_t> defining;
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    const GraphTag& tag = state_.tags[i];
    if (tag.component == kInWorkspace &&
        (!is_defined_ || definition_.contains({tag.tag_id, tag.epoch})))
      defining.push_back(i);
  }
  if (defining.empty()) return std::nullopt;
  auto covariance = GraphCovariance::of(state_);
  if (!covariance) return std::nullopt;
  if (!state_.prior.is_absolute) covariance->refer_to(defining);
  return covariance;
}

void MapGraph::tell(const GraphCovariance& covariance, GraphSolution& out) const {
  const auto is_current = [&](const GraphTag& tag) {
    return tag.epoch == epochs_.newest(tag.tag_id);
  };
  out.findings = findings_of(covariance, state_);
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    const GraphTag& tag = state_.tags[i];
    out.tags.push_back({tag.tag_id, tag.edge_m, tag.component, tag.sightings, tag.first_seen,
                        tag.last_seen, tag.X_WT, *covariance.between(i, i), tag.epoch,
                        is_current(tag)});
  }
  std::sort(out.tags.begin(), out.tags.end(), [](const auto& a, const auto& b) {
    return std::tuple(a.tag_id, a.component, a.epoch) < std::tuple(b.tag_id, b.component, b.epoch);
  });
  const auto is_told = [&](std::size_t i) {
    return state_.tags[i].component == kInWorkspace && is_current(state_.tags[i]);
  };
  for (const auto& [i, j] : bound_tags(state_)) {
    if (!is_told(i) || !is_told(j)) continue;
    const bool turned = state_.tags[i].tag_id > state_.tags[j].tag_id;
    const std::size_t first = turned ? j : i;
    const std::size_t second = turned ? i : j;
    if (const auto of_both = covariance.between(first, second))
      out.pairs.push_back({state_.tags[first].tag_id, state_.tags[second].tag_id, *of_both});
  }
  std::sort(out.pairs.begin(), out.pairs.end(), [](const KnownPair& a, const KnownPair& b) {
    return std::pair(a.first_id, a.second_id) < std::pair(b.first_id, b.second_id);
  });
}

}  // namespace fiducap
