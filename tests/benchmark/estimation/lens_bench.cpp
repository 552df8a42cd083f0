// A lens as a calibration leaves it: a twentieth of a pixel off, the same again wherever a tag is
// seen, with corners that scatter less. Told of that error, and not told.
#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "estimation/ensemble.hpp"
#include "estimation/options.hpp"
#include "estimation/parallel.hpp"
#include "simulation/told_lens.hpp"

namespace fiducap::bench {

namespace {

constexpr std::uint64_t kNextLens = 10'000;

struct LensArm {
  std::string name;
  double error_px{};  ///< That the lens has …
  double told_px{};   ///< … and is told to have.
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
  std::vector<EstimationData> data;
  for (int k = 0; k < one.robots; ++k) {
    SimulatedDataSetup setup;
    setup.world = one.world;
    setup.seconds = one.seconds;
    setup.seed = seed + kNextLens * static_cast<std::uint64_t>(k);
    data.push_back(behind_a_told_lens(setup, arm.error_px, arm.told_px));
  }
  for (EstimationData& robot : data) robot.reference_tag = data.front().reference_tag;
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
  using At = FilterRun::At;
  MeanSquare position, map;
  double nees = 0, map_nees = 0, worst = 0, with_pose = 0, with_tags = 0;
  int bodies = 0, wrong = 0, disputed = 0, said = 0, resets = 0;
  for (const TogetherRun& run : runs) {
    map.add(run.map_position_m);
    map_nees += run.map_nees / static_cast<double>(runs.size());
    wrong += lens_events(run, {MapEvent::Kind::kTagQuarantined, MapEvent::Kind::kTagMoved});
    disputed += lens_events(run, {MapEvent::Kind::kTagDisputed});
    for (const FilterRun& body : run.bodies) {
      position.add(body.rms([](const At& at) { return at.level_position_m; }));
      const double own = body.mean([](const At& at) { return at.nees.pose / 6; });
      nees += own;
      worst = std::max(worst, own);
      with_pose += body.frames_with_pose;
      with_tags += body.frames_with_tags;
      said += static_cast<int>(body.said.size());
      resets += body.resets;
      ++bodies;
    }
  }
  return {name,
          arm.name,
          Figure{kMm * position.rms(), 2},
          Figure{nees / bodies, 2},
          Figure{worst, 1},
          Figure{100 * with_pose / std::max(1.0, with_tags), 1},
          Figure{kMm * map.rms(), 2},
          Figure{map_nees, 2},
          std::to_string(wrong),
          std::to_string(disputed),
          std::to_string(said),
          std::to_string(resets)};
}

}  // namespace

std::vector<Table> bench_lens(const EstimationOptions& options) {
  Table table{fmt::format("A lens as calibrated, seeds {} to {}", options.first_seed,
                          options.first_seed + static_cast<std::uint64_t>(options.seeds) - 1),
              {"class", "lens", "pos mm", "NEES", "worst", "pose %", "map mm", "map NEES", "wrong",
               "disputed", "said", "resets"}};
  const std::vector<LensArm> arms{{"exact", 0, 0},       {"exact, told 0.05", 0, 0.05},
                                  {"0.05 off", 0.05, 0}, {"0.05 off, told", 0.05, 0.05},
                                  {"0.15 off", 0.15, 0}, {"0.15 off, told", 0.15, 0.15}};
  for (const std::string& name : options.classes) {
    const LensRoom one = lens_room(options, name);
    for (const LensArm& arm : arms) {
      if (!options.only.empty() &&
          std::none_of(options.only.begin(), options.only.end(),
                       [&](const std::string& o) { return arm.name.starts_with(o); }))
        continue;
      std::vector<TogetherRun> runs(static_cast<std::size_t>(options.seeds));
      in_parallel(options.seeds, options.threads, [&](int i) {
        runs[static_cast<std::size_t>(i)] =
            run_lens(options, one, arm, options.first_seed + static_cast<std::uint64_t>(i));
      });
      table.rows.push_back(lens_row(name, arm, runs));
    }
  }
  table.remarks.emplace_back(
      "Corners scatter by 0.03 px. NEES per degree of freedom, of poses and of the map's tags; "
      "`wrong`: tags that were taken out of the map or moved, none was; `said`: sentences of the "
      "bodies.");
  return {table};
}

}  // namespace fiducap::bench
