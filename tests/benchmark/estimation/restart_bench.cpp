// A robot in a room that its map knows: the time of its first pose, its error, and changes of the
// map.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/numeric.hpp"
#include "estimation/ensemble.hpp"
#include "estimation/options.hpp"

namespace fiducap::bench {

namespace {

constexpr double kFirst_s = 60;
constexpr double kStart_s = 10;
constexpr std::uint64_t kNextStart = 10'000;

struct Start {
  double first_valid_s{Nees::kNone};
  FilterRun body;
  double map_m{};
  double map_nees{};
};

/// Day one, and a start for each seed; each has the map of the one before.
Table run_class(const EstimationOptions& options, const std::string& world) {
  FilterChoice choice = choice_of(options, "world", 'A');
  choice.live = true;
  const EstimationData day_one =
      simulate({.world = world, .seconds = kFirst_s, .seed = options.first_seed});
  const TogetherRun built = run_together(std::span(&day_one, 1), choice);
  TagMap map = built.map;
  std::vector<Start> starts;
  for (int i = 1; i <= options.seeds; ++i) {
    EstimationData data =
        simulate({.world = world,
                  .seconds = kStart_s,
                  .seed = options.first_seed + kNextStart * static_cast<std::uint64_t>(i)});
    data.reference_tag = day_one.reference_tag;
    choice.start = map;
    TogetherRun run = run_together(std::span(&data, 1), choice);
    Start& start = starts.emplace_back();
    start.map_m = run.map_position_m;
    start.map_nees = run.map_nees;
    start.body = std::move(run.bodies.front());
    for (const FilterRun::At& at : start.body.at) {
      if (!at.valid) continue;
      start.first_valid_s = at.t_s;
      break;
    }
    map = std::move(run.map);
  }
  std::vector<double> waits, errors;
  MeanSquare position;
  double nees = 0;
  int tracked = 0;
  for (const Start& start : starts) {
    if (std::isnan(start.first_valid_s)) continue;
    ++tracked;
    waits.push_back(start.first_valid_s);
    const double error = start.body.position_rmse_m();
    position.add(error);
    errors.push_back(error);
    nees += start.body.mean([](const auto& at) { return at.nees.pose; }) / 6;
  }
  Table table{
      fmt::format("Restart in a known room: {}, {} starts after {:.0f} s of day one", world,
                  options.seeds, kFirst_s),
      split("with pose|first valid s|95 %|worst|pose mm|worst|pose NEES|map mm day one|NEES|"
            "after all|NEES|tags")};
  table.rows.push_back(cells(
      fmt::format("{}/{}", tracked, starts.size()), Figure{quantile(waits, 0.5), 2},
      Figure{quantile(waits, 0.95), 2}, Figure{largest(waits), 2}, Figure{kMm * position.rms(), 2},
      Figure{kMm * largest(errors), 2}, Figure{nees / std::max(1, tracked), 2},
      Figure{kMm * built.map_position_m, 2}, Figure{built.map_nees, 2},
      Figure{kMm * starts.back().map_m, 2}, Figure{starts.back().map_nees, 2}, map.tags.size()));
  table.remarks.emplace_back(
      "Seconds since the first sample, in virtual time; poses over all of each start of ten "
      "seconds. Every start begins with the map, and its correlations, of the one before.");
  return table;
}

}  // namespace

std::vector<Table> bench_restart(const EstimationOptions& options) {
  std::vector<Table> tables;
  for (const std::string& world : options.classes) tables.push_back(run_class(options, world));
  return tables;
}

}  // namespace fiducap::bench
