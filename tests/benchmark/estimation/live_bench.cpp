// The live path: pipelines over a growing map that is returned to them, beside the filter alone
// with the same samples; one body, and three that share the map.
#include <fmt/format.h>

#include <cmath>

#include "estimation/ensemble.hpp"
#include "estimation/options.hpp"

namespace fiducap::bench {

namespace {

constexpr int kBodies = 3;

struct LiveSeed {
  BoundRun bound;
  Instant first{};
  FilterRun alone;
  TogetherRun one;
  TogetherRun three;
};

LiveSeed run_one(const EstimationOptions& options, const std::string& world,
                 const std::string& filter, std::uint64_t seed) {
  const auto robots = robots_of(kBodies, seed, [&](int, std::uint64_t own) {
    return simulate({.world = world, .seconds = seconds_of(options, world), .seed = own});
  });
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

std::vector<Cell> row(const std::string& world, const std::string& filter, const std::string& arm,
                      const LiveScore& score, double bound_m) {
  return cells(world, filter, arm, score.position_mm(), Figure{score.position.rms() / bound_m, 2},
               score.nees(), Figure{score.worst_nees, 1}, score.pose_percent(), score.resets,
               score.map_mm(), score.nees_of_maps());
}

}  // namespace

std::vector<Table> bench_live(const EstimationOptions& options) {
  Table table{
      fmt::format("The live path, {} seeds, reference tag given: poses and map in level axes",
                  options.seeds),
      split("class|filter|arm|pos mm|/bound|pose NEES|worst|with pose %|resets|map mm|map NEES")};
  for (const std::string& world : options.classes) {
    for (const std::string& filter : options.filters) {
      const auto seeds = for_seeds(
          options, [&](std::uint64_t seed) { return run_one(options, world, filter, seed); });
      LiveScore alone, one, three;
      MeanSquare limit;
      for (const LiveSeed& seed : seeds) {
        limit.add(rms(seed.bound, seed.first, &bound::BoundAt::level_position_m));
        alone.add(seed.alone);
        one.add(seed.one);
        three.add(seed.three);
      }
      table.rows.push_back(row(world, filter, "filter alone", alone, limit.rms()));
      table.rows.push_back(row(world, filter, "live, 1 body", one, limit.rms()));
      table.rows.push_back(row(world, filter, "live, 3 bodies", three, limit.rms()));
    }
  }
  table.remarks.emplace_back(
      "live: BodiesReplay, the objects of the server with its map's feedback, in virtual time. "
      "Bound: of the first robot alone, for all three.");
  table.remarks.emplace_back(
      "NEES per degree of freedom, mean over runs; worst: of one run. Three bodies with the map "
      "graph, as a server has it.");
  return {table};
}

}  // namespace fiducap::bench
