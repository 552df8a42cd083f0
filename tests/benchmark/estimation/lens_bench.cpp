// A calibrated lens with an error of a twentieth of a pixel that is constant at each place of the
// image, with corners that scatter less. With and without this error in the configuration.
#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "estimation/ensemble.hpp"
#include "estimation/options.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap::bench {

namespace {

struct LensArm {
  std::string name;
  double error_px{};       ///< True …
  double configured_px{};  ///< … and configured.
};

struct LensRoom {
  std::string world;
  int robots{1};
  double seconds{};
};

/// WORLD or WORLD-ROBOTS
LensRoom lens_room(const EstimationOptions& options, const std::string& name) {
  const std::size_t dash = name.find('-');
  LensRoom out{name.substr(0, dash), 1, seconds_of(options, name.substr(0, dash))};
  if (dash != std::string::npos) out.robots = std::stoi(name.substr(dash + 1));
  return out;
}

TogetherRun run_lens(const EstimationOptions& options, const LensRoom& one, const LensArm& arm,
                     std::uint64_t seed) {
  const auto data = robots_of(one.robots, seed, [&](int, std::uint64_t own) {
    return with_calibrated_lens({.world = one.world, .seconds = one.seconds, .seed = own},
                                arm.error_px, arm.configured_px);
  });
  FilterChoice choice = choice_of(options, "world", 'A');
  choice.live = true;
  choice.refine_period_s = refine_period_for(data.size());
  TogetherRun run = run_together(data, choice);
  for (FilterRun& body : run.bodies) body = body.scored_after(kSettled_s);
  if (options.each) {
    for (const FilterRun& body : run.bodies)
      for (const std::string& text : body.said)
        fmt::print("{} seed {}, {}: {}\n", one.world, seed, arm.name, text);
  }
  return run;
}

int lens_events(const TogetherRun& run, std::initializer_list<MapEvent::Kind> kinds) {
  return static_cast<int>(
      std::count_if(run.map_events.begin(), run.map_events.end(), [&](const MapEvent& event) {
        return std::find(kinds.begin(), kinds.end(), event.kind) != kinds.end();
      }));
}

std::vector<Cell> lens_row(const std::string& name, const LensArm& arm,
                           const std::vector<TogetherRun>& runs) {
  LiveScore score;
  int wrong = 0, inconsistent = 0, reports = 0;
  for (const TogetherRun& run : runs) {
    score.add(run);
    wrong += lens_events(run, {MapEvent::Kind::kTagQuarantined, MapEvent::Kind::kTagMoved});
    inconsistent += lens_events(run, {MapEvent::Kind::kTagDisputed});
    for (const FilterRun& body : run.bodies) reports += static_cast<int>(body.said.size());
  }
  return cells(name, arm.name, score.position_mm(), score.nees(), Figure{score.worst_nees, 1},
               score.pose_percent(), score.map_mm(), score.nees_of_maps(), wrong, inconsistent,
               reports, score.resets);
}

}  // namespace

std::vector<Table> bench_lens(const EstimationOptions& options) {
  Table table{
      fmt::format("A lens as calibrated, seeds {} to {}", options.first_seed, options.last_seed()),
      split("class|lens|pos mm|NEES|worst|pose %|map mm|map NEES|wrong|inconsistent|reports|"
            "resets")};
  const std::vector<LensArm> arms{{"exact", 0, 0},       {"exact, configured 0.05", 0, 0.05},
                                  {"0.05 off", 0.05, 0}, {"0.05 off, configured", 0.05, 0.05},
                                  {"0.15 off", 0.15, 0}, {"0.15 off, configured", 0.15, 0.15}};
  for (const std::string& name : options.classes) {
    const LensRoom one = lens_room(options, name);
    for (const LensArm& arm : arms) {
      if (!options.includes(arm.name)) continue;
      const auto runs =
          for_seeds(options, [&](std::uint64_t seed) { return run_lens(options, one, arm, seed); });
      table.rows.push_back(lens_row(name, arm, runs));
    }
  }
  table.remarks.emplace_back(
      "Corners scatter by 0.03 px. NEES per degree of freedom, of poses and of the map's tags; "
      "`wrong`: tags that were removed from the map or moved, falsely; `reports`: of the bodies.");
  return {table};
}

}  // namespace fiducap::bench
