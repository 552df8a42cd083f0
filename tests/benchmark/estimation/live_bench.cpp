// The live path: pipelines over a map that grows and is handed back, beside the filter alone with
// the same samples; one body, and three that share the map.
#include <fmt/format.h>

#include <cmath>

#include "estimation/ensemble.hpp"
#include "estimation/options.hpp"
#include "estimation/parallel.hpp"

namespace fiducap::bench {

namespace {

constexpr int kBodies = 3;
// Each robot of a session has motion and noise of its own.
constexpr std::uint64_t kNextRobot = 10'000;

struct LiveSeed {
  BoundRun bound;
  Instant first{};
  FilterRun alone;
  TogetherRun one;
  TogetherRun three;
};

LiveSeed run_one(const EstimationOptions& options, const std::string& world,
                 const std::string& filter, std::uint64_t seed) {
  std::vector<EstimationData> robots;
  for (int k = 0; k < kBodies; ++k)
    robots.push_back(simulate({.world = world,
                               .seconds = seconds_of(options, world),
                               .seed = seed + kNextRobot * static_cast<std::uint64_t>(k)}));
  // One room has one reference tag.
  for (EstimationData& robot : robots) robot.reference_tag = robots.front().reference_tag;
  LiveSeed out;
  out.first = time_of(robots.front().samples.front());
  out.bound = run_bound(robots.front(), {'A'});
  FilterChoice choice = choice_of(options, filter, 'A');
  out.alone = run_filter(robots.front(), choice).scored_after(kSettled_s);
  choice.live = true;
  out.one = run_together(std::span(robots).first(1), choice);
  choice.refine_period_s = refine_period_for(robots.size());
  out.three = run_together(robots, choice);
  for (TogetherRun* run : {&out.one, &out.three})
    for (FilterRun& body : run->bodies) body = body.scored_after(kSettled_s);
  return out;
}

/// What one arm shows over all seeds.
struct Sum {
  MeanSquare position, bound, map;
  double pose_nees{}, map_nees{};
  int nees_count{}, maps{};
  double with_pose{}, with_tags{};
  int resets{};
  double worst_nees{};

  void add(const FilterRun& run, double bound_m) {
    position.add(run.rms([](const auto& at) { return at.level_position_m; }));
    bound.add(bound_m);
    const double nees = run.mean([](const auto& at) { return at.nees.pose; }) / 6;
    if (!std::isnan(nees)) {
      pose_nees += nees;
      worst_nees = std::max(worst_nees, nees);
      ++nees_count;
    }
    with_pose += run.frames_with_pose;
    with_tags += run.frames_with_tags;
    resets += run.resets;
  }
  void add_map(const TogetherRun& run) {
    if (run.map.tags.empty()) return;
    map.add(run.map_position_m);
    map_nees += run.map_nees;
    ++maps;
  }
  [[nodiscard]] std::vector<Cell> row(const std::string& world, const std::string& filter,
                                      const std::string& arm) const {
    return {world,
            filter,
            arm,
            Figure{kMm * position.rms(), 2},
            Figure{position.rms() / bound.rms(), 2},
            Figure{pose_nees / std::max(1, nees_count), 2},
            Figure{worst_nees, 1},
            Figure{100 * with_pose / std::max(1.0, with_tags), 1},
            std::to_string(resets),
            Figure{kMm * map.rms(), 2},
            Figure{maps == 0 ? Nees::kNone : map_nees / maps, 2}};
  }
};

}  // namespace

std::vector<Table> bench_live(const EstimationOptions& options) {
  Table table{
      fmt::format("The live path, {} seeds, reference tag given: poses and map in level axes",
                  options.seeds),
      {"class", "filter", "arm", "pos mm", "/bound", "pose NEES", "worst", "with pose %", "resets",
       "map mm", "map NEES"}};
  for (const std::string& world : options.classes) {
    for (const std::string& filter : options.filters) {
      std::vector<LiveSeed> seeds(static_cast<std::size_t>(options.seeds));
      in_parallel(options.seeds, options.threads, [&](int i) {
        seeds[static_cast<std::size_t>(i)] =
            run_one(options, world, filter, options.first_seed + static_cast<std::uint64_t>(i));
      });
      Sum alone, one, three;
      for (const LiveSeed& seed : seeds) {
        const double bound_m = rms(seed.bound, seed.first, &bound::BoundAt::level_position_m);
        alone.add(seed.alone, bound_m);
        one.add(seed.one.bodies.front(), bound_m);
        one.add_map(seed.one);
        for (const FilterRun& body : seed.three.bodies) three.add(body, bound_m);
        three.add_map(seed.three);
      }
      table.rows.push_back(alone.row(world, filter, "filter alone"));
      table.rows.push_back(one.row(world, filter, "live, 1 body"));
      table.rows.push_back(three.row(world, filter, "live, 3 bodies"));
    }
  }
  table.remarks.emplace_back(
      "live: BodiesReplay, the objects of the server with its map's feedback, in virtual time. "
      "Bound: "
      "of the first robot alone, for all three.");
  table.remarks.emplace_back(
      "NEES per degree of freedom, mean over runs; worst: of one run. Three bodies with the map "
      "graph, as a server has it.");
  return {table};
}

}  // namespace fiducap::bench
