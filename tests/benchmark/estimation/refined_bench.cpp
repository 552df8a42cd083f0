// Map and poses online and after the run: of the filter, and of a joint solution of all data,
// against the causal and the smoothing bound.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "estimation/ensemble.hpp"
#include "simulation/refined_run.hpp"

namespace fiducap::bench {

namespace {

constexpr int kSmoothed = 20;  // poses of a run, spread evenly

struct Pair {
  double error_m{Nees::kNone};
  double bound_m{Nees::kNone};
};

struct Refined {
  std::string name;
  // In the reference tag's axes.
  Pair map_online, map_refined;
  Pair pose_online, pose_refined;
  Pair gap_before, gap_after;  ///< A loop that is closed, online; and refined at `before`.
  Pair gap_refined;
  Pair sigma_refined;                     ///< In W: of refined poses, and the smoothing bound.
  double nees_of_poses{}, nees_of_map{};  ///< Refined, in W, per number.
  int online_tags{}, refined_tags{}, bound_tags{};
  bool is_at_rest{};
};

struct Column {
  const char* name;
  Pair Refined::*pair;
};
const Column kColumns[] = {
    {"map", &Refined::map_online},          {"map refined", &Refined::map_refined},
    {"pos", &Refined::pose_online},         {"pos refined", &Refined::pose_refined},
    {"gap", &Refined::gap_before},          {"gap after", &Refined::gap_after},
    {"gap refined", &Refined::gap_refined}, {"sigma refined", &Refined::sigma_refined}};

/// The pose of an image, nullptr when there is none.
const FilterRun::At* at_instant(const FilterRun& run, double t_s) {
  constexpr double kSame_s = 1e-6;
  const auto found = std::find_if(run.at.begin(), run.at.end(), [&](const FilterRun::At& at) {
    return std::abs(at.t_s - t_s) < kSame_s;
  });
  return found == run.at.end() ? nullptr : &*found;
}

/// Errors of refined poses at the very images for which the bound is known.
void compare_poses(const RefinedRun& refined, const BoundRun& bound, Instant first,
                   const std::optional<Closure>& closure, Refined& out) {
  MeanSquare error;
  MeanSquare limit;
  MeanSquare sigma;
  MeanSquare level;
  for (const bound::PoseBound& one : bound.smoothed) {
    const FilterRun::At* at = at_instant(refined.poses, to_seconds(one.at - first));
    if (at == nullptr) continue;
    if (closure && one.at == closure->before) {
      out.gap_refined = {at->position_m, one.position_m};
      continue;  // not one of the evenly spread images
    }
    error.add(at->position_m);
    limit.add(one.position_m);
    sigma.add(at->sigma_m);
    level.add(one.level_position_m);
  }
  out.pose_refined = {error.rms(), limit.rms()};
  out.sigma_refined = {sigma.rms(), level.rms()};
}

Refined run_one(const EstimationOptions& options, const EstimationData& data) {
  Refined out;
  out.name = data.name;
  const Instant first = time_of(data.samples.front());
  const std::optional<Closure> closure = closure_of(data);
  std::vector<Instant> kept = images_spread(data, kSmoothed, kSettled_s);
  if (closure) kept.push_back(closure->before);
  const BoundRun bound = run_bound(data, {'A'}, kept);
  FilterChoice choice = choice_of(options, "world", 'A');
  choice.live = true;
  const FilterRun online = run_filter(data, choice).scored_after(kSettled_s);
  const RefinedRun refined = run_refined(data, choice);
  // The bound of a map has its tags only.
  const auto of = [&](const std::vector<int>& ids) {
    return map_bound(bound.tags, data.tags, data.reference_tag, ids).position_m;
  };
  out.map_online = {online.near_map_position_m, of(online.map_ids)};
  out.map_refined = {refined.map.near_position_m, of(refined.map.ids)};
  out.pose_online = {online.rms([](const auto& at) { return at.position_m; }),
                     rms(bound, first, &bound::BoundAt::position_m)};
  compare_poses(refined, bound, first, closure, out);
  if (online.gap_path_m > 0 && bound.gap && bound.gap_after) {
    out.gap_before = {online.gap_m, bound.gap->position_m};
    out.gap_after = {online.gap_after_m, bound.gap_after->position_m};
  }
  out.nees_of_poses =
      refined.poses.scored_after(kSettled_s).mean([](const auto& at) { return at.nees.pose / 6; });
  out.nees_of_map = refined.map.nees;
  out.online_tags = static_cast<int>(online.map_ids.size());
  out.refined_tags = static_cast<int>(refined.map.ids.size());
  out.bound_tags = static_cast<int>(bound.tags.ids.size());
  out.is_at_rest = refined.is_at_rest;
  return out;
}

std::vector<Cell> row_of(const std::string& world, const Refined& run) {
  std::vector<Cell> row{world, run.name};
  for (const Column& column : kColumns) {
    const Pair& pair = run.*column.pair;
    row.push_back(Figure{kMm * pair.error_m, 2});
    row.push_back(Figure{pair.error_m / pair.bound_m, 2});
  }
  row.push_back(Figure{run.nees_of_poses, 2});
  row.push_back(Figure{run.nees_of_map, 2});
  row.push_back(fmt::format("{} {} {}", run.online_tags, run.refined_tags, run.bound_tags));
  row.push_back(run.is_at_rest ? "" : "not at rest");
  return row;
}

/// Root of the mean square over runs, and its ratio to the bound's.
std::string over_seeds(const std::string& world, const std::vector<Refined>& runs) {
  std::string out =
      fmt::format("{}, RMS over {} seeds, mm (ratio to the bound's):", world, runs.size());
  for (const Column& column : kColumns) {
    MeanSquare error;
    MeanSquare limit;
    for (const Refined& run : runs) {
      const Pair& pair = run.*column.pair;
      if (std::isnan(pair.error_m) || std::isnan(pair.bound_m)) continue;
      error.add(pair.error_m);
      limit.add(pair.bound_m);
    }
    if (error.count > 0)
      out += fmt::format(" {} {:.3f} ({:.2f})", column.name, kMm * error.rms(),
                         error.rms() / limit.rms());
  }
  double poses = 0;
  double map = 0;
  for (const Refined& run : runs) {
    poses += run.nees_of_poses / static_cast<double>(runs.size());
    map += run.nees_of_map / static_cast<double>(runs.size());
  }
  return out + fmt::format("; NEES of refined poses {:.2f}, map {:.2f}", poses, map);
}

}  // namespace

std::vector<Table> bench_refined(const EstimationOptions& options) {
  Table table{"Online and refined, case A, in the reference tag's axes (mm)", {"class", "run"}};
  for (const Column& column : kColumns) {
    table.columns.emplace_back(column.name);
    table.columns.emplace_back("/bound");
  }
  for (const char* name : {"NEES poses", "NEES map", "tags", ""}) table.columns.emplace_back(name);
  for (const std::string& world : options.classes) {
    if (const auto data = load_estimation_data(options.data + "/sim_" + world))
      table.rows.push_back(row_of(world, run_one(options, *data)));
    else
      table.remarks.emplace_back("NOT RUN: " + data.error().text());
    const auto runs = for_seeds(options, [&](std::uint64_t seed) {
      const double seconds = seconds_of(options, world);
      return run_one(options, simulate({.world = world, .seconds = seconds, .seed = seed}));
    });
    for (const Refined& run : runs) table.rows.push_back(row_of(world, run));
    if (!runs.empty()) table.remarks.push_back(over_seeds(world, runs));
  }
  table.remarks.emplace_back(
      fmt::format("`map`, `pos`: of the filter, map at the end over the bound of the tags by all "
                  "data, poses from 5 s on over the causal bound; `map refined`, `pos refined`: of "
                  "`replay --resolve`, poses at {} images over the smoothing bound there. `gap`: "
                  "before the reference tag is seen again, `after`: by that image, both over the "
                  "causal bound; `gap refined`: the refined pose before it, over the smoothing "
                  "bound. `sigma refined`: of those poses in W, over the bound there. NEES per "
                  "number, refined, in W. Tags: of the filter, refined, of the bound.",
                  kSmoothed));
  return {table};
}

}  // namespace fiducap::bench
