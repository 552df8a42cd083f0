// One map of several robots: a ring of 92 m with 100 tags, of which each robot walks its share back
// and forth. Their filters with the live map, and the map graph over their segments.
#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "base/pose.hpp"
#include "estimation/ensemble.hpp"
#include "estimation/options.hpp"
#include "mapping/graph/map_graph.hpp"
#include "mapping/tag_map.hpp"
#include "simulation/published_steps.hpp"
#include "support/bound/joint_map_bound.hpp"

namespace fiducap::bench {

namespace {

constexpr double kSeconds = 240;
constexpr double kRefine_s = 2;
constexpr double kRamp_s = 2;
constexpr double kPercent = 100;
constexpr double kShareOfThree = 0.45;
constexpr std::size_t kFoldedAt = 150;
// The bound of a body with 300 tags takes longer than all the rest.
constexpr int kMostWithBound = 3;

struct MapScore {
  double raw_m{};    ///< In W.
  double level_m{};  ///< Without errors of origin and heading.
  double level_rad{};
  double nees{};     ///< In W, per degree of freedom.
  double sigma_m{};  ///< Of the map, RMS.
  int tags{};
  int unknown{};  ///< Of those: all but the reference tag.
};

template <class Tags, class Entry>
MapScore score(const Tags& tags, const EstimationData& data, const Entry& entry) {
  const Pose X_WR = workspace_of(data);
  MapScore out;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const auto& tag : tags) {
    const auto [tag_id, X_WT, covariance] = entry(tag);
    points.emplace_back(X_WT.p, (X_WR * data.tag(tag_id)->X_WT).p);
  }
  const Pose level = fit_yaw_and_shift(points);
  for (const auto& tag : tags) {
    const auto [tag_id, X_WT, covariance] = entry(tag);
    const Pose truth = X_WR * data.tag(tag_id)->X_WT;
    const Pose X = level * X_WT;
    out.raw_m += (X_WT.p - truth.p).squaredNorm();
    out.level_m += (X.p - truth.p).squaredNorm();
    out.level_rad += std::pow(angle_between(X.q, truth.q), 2);
    if (tag_id != data.reference_tag) {  // its place is known
      out.nees += normalised(pose_error(X_WT, truth), covariance) / 6;
      ++out.unknown;
    }
    out.sigma_m += covariance.diagonal().template head<3>().sum();
    ++out.tags;
  }
  const double n = std::max(1, out.tags);
  out.raw_m = std::sqrt(out.raw_m / n);
  out.level_m = std::sqrt(out.level_m / n);
  out.level_rad = std::sqrt(out.level_rad / n);
  out.sigma_m = std::sqrt(out.sigma_m / n);
  out.nees /= std::max(1, out.unknown);
  return out;
}

MapScore score(const GraphSolution& solution, const EstimationData& data) {
  std::vector<GraphTagEstimate> joined;
  for (const GraphTagEstimate& tag : solution.tags)
    if (tag.component == 0) joined.push_back(tag);
  return score(joined, data, [](const GraphTagEstimate& t) {
    return std::tuple(t.tag_id, t.X_WT, t.covariance);
  });
}

/// Of the tags that are in a map, by all data of all bodies: not the graph's own.
bound::MapFigures bound_of(const std::vector<EstimationData>& data, const TagMap& map) {
  std::vector<bound::TagsCovariance> bodies;
  for (const EstimationData& one : data) bodies.push_back(run_bound(one, {'A'}).tags);
  std::vector<int> ids;
  for (const MapTag& tag : map.tags) ids.push_back(tag.tag.tag_id);
  const EstimationData& first = data.front();
  return figures_of(bound::joint_map_bound(first.tags, first.reference_tag, bodies), ids);
}

struct RingRun {
  MapScore live;
  std::optional<bound::MapFigures> bound;
  MapScore graph;
  MapScore folded;
  std::vector<double> position_m;
  std::vector<double> level_m;  ///< Without errors of origin and heading of the map.
  std::vector<double> nees;
  std::vector<double> tracks_after_s;
  StepFigures ramped;   ///< Of all robots.
  StepFigures at_once;  ///< … if corrections of the map were not ramped.
  double chi_square{};
  double solve_s{};
  int iterations{};
  int condensed{};
  std::size_t nodes{};
};

/// Ramped, and at once.
std::string pair_of(double ramped, double at_once, int decimals) {
  return fmt::format("{:.{}f} {:.{}f}", ramped, decimals, at_once, decimals);
}

std::vector<EstimationData> robots_on_ring(const EstimationOptions& options, int robots,
                                           std::uint64_t seed) {
  return robots_of(robots, seed, [&](int k, std::uint64_t own) {
    SimulatedDataSetup setup;
    setup.world = "ring";
    setup.seconds = options.seconds > 0 ? options.seconds : kSeconds;
    setup.seed = own;
    if (robots > 3) setup.ring = {276, 300};
    setup.from = static_cast<double>(k) / robots;
    setup.share = robots == 1 ? 1.0 : robots == 3 ? kShareOfThree : 1.35 / robots;
    return simulate(setup);
  });
}

/// Errors of one robot with the live map.
struct BodyScore {
  MeanSquare position, level;
  double nees{};
  int images{};
  double tracks_after_s{Nees::kNone};

  void add(const BodyEstimate& estimate, const Pose& X_WR, const EstimationData& data,
           const TagMap& map) {
    const Pose truth = X_WR * data.truth_near(estimate.at).X_WB;
    const Vector6d e = pose_error(estimate.X_WB, truth);
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
    for (const MapTag& tag : map.tags)
      points.emplace_back(tag.tag.X_WT.p, (X_WR * data.tag(tag.tag.tag_id)->X_WT).p);
    level.add((fit_yaw_and_shift(points) * estimate.X_WB.p - truth.p).norm());
    position.add(e.head<3>().norm());
    nees += normalised(e, estimate.covariance.topLeftCorner<6, 6>()) / 6;
    ++images;
  }
};

void solve(MapGraph& graph, MapGraph& folded, const EstimationData& data, RingRun& out) {
  const auto begin = std::chrono::steady_clock::now();
  const auto solution = graph.solve();
  out.solve_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!solution) return;
  out.nodes = graph.state().nodes.size();
  out.iterations = solution->iterations;
  out.condensed = solution->condensed;
  out.chi_square = solution->cost / solution->numbers;
  out.graph = score(*solution, data);
  if (const auto of_folded = folded.solve()) out.folded = score(*of_folded, data);
}

RingRun run_one(const EstimationOptions& options, int robots, std::uint64_t seed) {
  const auto data = robots_on_ring(options, robots, seed);
  FilterChoice choice = choice_of(options, "world", 'A');
  choice.live = true;
  choice.refine_period_s = kRefine_s;
  TagMap nothing;
  nothing.reference_tag = data.front().reference_tag;
  MapGraph graph(nothing);
  MapGraph folded(nothing);
  RingRun out;
  const Instant first = time_of(data.front().samples.front());
  const Pose X_WR = workspace_of(data.front());
  std::vector<BodyScore> scores(data.size());
  std::vector<PublishedSteps> ramped, at_once;
  for (const EstimationData& one : data) {
    const PipelineSetup setup = pipeline_of(one, choice);
    ramped.emplace_back(one, setup.sensors, setup.estimator, RampConfig{.seconds = kRamp_s});
    at_once.emplace_back(one, setup.sensors, setup.estimator, RampConfig{});
  }
  choice.listen = [&](std::size_t body, const BodyUpdate& update, const TagMap& map) {
    ramped[body].take(update);
    at_once[body].take(update);
    const double t_s = to_seconds(update.seen.exposed_at - first);
    if (update.is_placed() && t_s > kSettled_s && map.tags.size() > 2)
      scores[body].add(*update.estimate, X_WR, data[body], map);
    if (update.is_placed() && std::isnan(scores[body].tracks_after_s))
      scores[body].tracks_after_s = t_s;
    if (!update.segment) return;
    MotionSegment segment = *update.segment;
    segment.body_id = static_cast<int>(body) + 1;
    (void)folded.add(segment);
    (void)graph.add(std::move(segment));
    if (folded.state().segments.size() >= kFoldedAt && folded.solve()) folded.fold();
  };
  const TogetherRun run = run_together(data, choice);
  out.live = score(run.map.tags, data.front(), [](const MapTag& t) {
    return std::tuple(t.tag.tag_id, t.tag.X_WT, t.tag.covariance);
  });
  if (robots <= kMostWithBound) out.bound = bound_of(data, run.map);
  for (const BodyScore& body : scores) {
    out.position_m.push_back(body.position.rms());
    out.level_m.push_back(body.level.rms());
    out.nees.push_back(body.nees / std::max(1, body.images));
    out.tracks_after_s.push_back(body.tracks_after_s);
  }
  for (const PublishedSteps& one : ramped) out.ramped.add(one.figures());
  for (const PublishedSteps& one : at_once) out.at_once.add(one.figures());
  solve(graph, folded, data.front(), out);
  return out;
}

std::string list(const std::vector<double>& values, double unit, int decimals) {
  std::string out;
  for (const double value : values)
    out += fmt::format("{}{:.{}f}", out.empty() ? "" : " ", unit * value, decimals);
  return out;
}

/// A live error beside its bound: bound in mm, ratio.
void add_bound(const RingRun& run, double bound::MapFigures::*limit, double error_m,
               std::vector<Cell>& row) {
  const double bound_m = run.bound ? run.bound.value().*limit : Nees::kNone;
  row.push_back(Figure{kMm * bound_m, 2});
  row.push_back(Figure{error_m / bound_m, 2});
}

std::vector<Cell> row_of(const std::string& name, std::uint64_t seed, const RingRun& run) {
  std::vector<Cell> row = cells(
      name, seed, Figure{kMm * run.live.raw_m, 1}, Figure{kMm * run.live.level_m, 2},
      Figure{kDegreesPerRadian * run.live.level_rad, 3}, Figure{kMm * run.live.sigma_m, 2},
      Figure{run.live.nees, 2}, run.live.tags, list(run.position_m, kMm, 0),
      list(run.level_m, kMm, 1), list(run.nees, 1, 1), list(run.tracks_after_s, 1, 1),
      pair_of(run.ramped.position, run.at_once.position, 2),
      pair_of(run.ramped.attitude, run.at_once.attitude, 2),
      pair_of(kMm * run.ramped.sigma_m / run.ramped.valid,
              kMm * run.at_once.sigma_m / run.at_once.valid, 2),
      pair_of(kPercent * run.ramped.valid / run.ramped.frames,
              kPercent * run.at_once.valid / run.at_once.frames, 2),
      Figure{kMm * run.graph.level_m, 2}, Figure{run.graph.nees, 2},
      Figure{kMm * run.folded.level_m, 2}, Figure{run.folded.nees, 2}, Figure{run.chi_square, 3},
      run.nodes, Figure{run.solve_s, 2}, run.iterations, run.condensed);
  add_bound(run, &bound::MapFigures::level_m, run.live.level_m, row);
  add_bound(run, &bound::MapFigures::raw_m, run.live.raw_m, row);
  return row;
}

std::string ratio_over_seeds(const std::string& robots, const std::vector<RingRun>& runs) {
  MeanSquare level, raw, level_bound, raw_bound;
  for (const RingRun& run : runs) {
    if (!run.bound) continue;
    level.add(run.live.level_m);
    raw.add(run.live.raw_m);
    level_bound.add(run.bound->level_m);
    raw_bound.add(run.bound->raw_m);
  }
  if (level.count == 0) return robots + " robots: no bound, it would take too long";
  return fmt::format(
      "{} robots, RMS of {} seeds over that of their bounds: levelled {:.2f} / "
      "{:.2f} mm = {:.2f}, in W {:.1f} / {:.1f} mm = {:.2f}",
      robots, level.count, kMm * level.rms(), kMm * level_bound.rms(),
      level.rms() / level_bound.rms(), kMm * raw.rms(), kMm * raw_bound.rms(),
      raw.rms() / raw_bound.rms());
}

}  // namespace

std::vector<Table> bench_ring(const EstimationOptions& options) {
  Table table{
      fmt::format("One map of several robots, seeds {} to {}", options.first_seed,
                  options.last_seed()),
      split("robots|seed|raw mm|level|deg|sigma|NEES|tags|bodies mm|level|NEES of bodies|"
            "track after s|step|turn|published sigma|valid %|solved again mm|/NEES|folded mm|"
            "/NEES|chi2|nodes|s|its|again|bound mm|/bound|bound W|/bound")};
  for (const std::string& name : options.classes) {
    const int robots = std::stoi(name);
    const auto runs =
        for_seeds(options, [&](std::uint64_t seed) { return run_one(options, robots, seed); });
    for (std::size_t i = 0; i < runs.size(); ++i)
      table.rows.push_back(row_of(name, options.first_seed + i, runs[i]));
    table.remarks.push_back(ratio_over_seeds(name, runs));
  }
  table.remarks.emplace_back(
      "Up to `track after`: the published map and poses, by the objects of the server in virtual "
      "time; `level`: without errors of origin and heading. `step` and `turn`: the largest between "
      "published frames, 100 a second, beyond the motion, in published sigmas; those, their mean "
      "sigma and the share of valid ones with map.correction_ramp_s and without. `solved again`: a "
      "graph of the same segments, solved once at the end; `folded`: one that makes a prior of "
      "every 150 of them; zeros when it does not converge. `bound`: smoothing bound of the tags by "
      "all bodies, levelled like the map, and in W; none for more than three robots.");
  return {table};
}

}  // namespace fiducap::bench
