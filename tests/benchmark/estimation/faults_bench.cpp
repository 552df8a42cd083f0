// Faults of practice, one at a time: errors with and without it over the same seeds.
#include <fmt/format.h>

#include <algorithm>

#include "estimation/ensemble.hpp"
#include "estimation/options.hpp"

namespace fiducap::bench {

namespace {

using At = FilterRun::At;

struct Fault {
  std::string name;
  std::function<void(SimulatedDataSetup&, const EstimationData& clean)> insert;
};

std::vector<Fault> faults() {
  return {
      {"none", [](auto&, const auto&) {}},
      {"1 % wrong ids", [](auto& s, const auto&) { s.faults.wrong_id = 0.01; }},
      {"10 % corners covered", [](auto& s, const auto&) { s.faults.occlude_corner = 0.1; }},
      {"tag moved 0.3 m",
       [](auto& s, const auto& clean) {
         s.faults.moved_tag = most_seen_tag(clean);
         s.faults.moved_at_s = 0.5 * s.seconds;
         s.faults.moved_by_m = {0.2, 0.2, 0.1};
       }},
      {"images stamped +50 ms", [](auto& s, const auto&) { s.faults.image_stamp_error_s = 0.05; }},
      {"images stamped -50 ms", [](auto& s, const auto&) { s.faults.image_stamp_error_s = -0.05; }},
      {"5 % IMU lost, 2 ms jitter",
       [](auto& s, const auto&) {
         s.faults.drop_imu = 0.05;
         s.faults.imu_stamp_jitter_s = 0.002;
       }},
      {"extrinsics 5 deg, 5 cm off",
       [](auto& s, const auto&) {
         s.extrinsics_sigma_m = 0.05 / std::sqrt(3.0);
         s.extrinsics_sigma_rad = 5 / kDegreesPerRadian / std::sqrt(3.0);
       }},
      {"IMU saturated for 3 s", [](auto& s, const auto&) {
         s.faults.saturation_at_s = 0.5 * s.seconds;
         s.faults.saturation_s = 3.0;
       }}};
}

double median_position(const std::vector<SeedRuns>& seeds, std::size_t filter) {
  std::vector<double> all;
  for (const SeedRuns& seed : seeds) all.push_back(seed.runs[filter].position_rmse_m());
  return median(all);
}

struct Totals {
  double nees{}, tags_dropped{}, rejected{}, used{}, with_pose{}, with_tags{};
  int lost{};
};

Totals totals_of(const std::vector<SeedRuns>& seeds, std::size_t filter) {
  Totals all;
  for (const SeedRuns& seed : seeds) {
    const FilterRun& run = seed.runs[filter];
    all.nees +=
        run.mean([](const At& at) { return at.nees.pose / 6; }) / static_cast<double>(seeds.size());
    all.tags_dropped += run.tags_dropped / static_cast<double>(seeds.size());
    all.rejected += run.tags_rejected;
    all.used += run.tags_used;
    all.with_pose += run.frames_with_pose;
    all.with_tags += run.frames_with_tags;
    all.lost += diverged(seed, filter) ? 1 : 0;
  }
  return all;
}

std::vector<Cell> figures(const std::vector<SeedRuns>& seeds, std::size_t f, double without) {
  const double position = ensemble_rms(seeds, f, &At::level_position_m);
  const Totals all = totals_of(seeds, f);
  return cells(Figure{kMm * position, 2}, Figure{kMm * without, 2}, Figure{position / without, 2},
               Figure{position / ensemble_rms(seeds, &bound::BoundAt::level_position_m), 2},
               Figure{kMm * median_position(seeds, f), 2},
               Figure{kDegreesPerRadian * ensemble_rms(seeds, f, &At::level_rotation_rad), 3},
               Figure{kMm * ensemble_rms(seeds, f, &At::velocity_m_s), 1}, Figure{all.nees, 2},
               Figure{100 * all.with_pose / all.with_tags, 1},
               Figure{100 * all.rejected / (all.used + all.rejected), 2},
               Figure{all.tags_dropped, 1}, all.lost);
}

}  // namespace

std::vector<Table> bench_faults(const EstimationOptions& options) {
  Table table{
      fmt::format("Faults, {} seeds: RMSE over seeds in level axes (mm, deg, mm/s)", options.seeds),
      split(
          "class|case|fault|filter|pos|without|with/without|/bound|median|ori|vel|pose NEES|pose %|"
          "rejected %|dropped|diverged")};
  for (const std::string& world : options.classes) {
    for (const char letter : options.cases) {
      std::vector<double> without(options.filters.size());
      for (const Fault& fault : faults()) {
        const auto clean = [&](std::uint64_t seed) {
          return simulate({.world = world, .seconds = seconds_of(options, world), .seed = seed});
        };
        const auto broken = [&](std::uint64_t seed) {
          SimulatedDataSetup setup{
              .world = world, .seconds = seconds_of(options, world), .seed = seed};
          fault.insert(setup, clean(seed));
          return simulate(setup);
        };
        const auto seeds = run_seeds(options, letter, broken, clean);
        for (std::size_t f = 0; f < options.filters.size(); ++f) {
          if (fault.name == "none") without[f] = ensemble_rms(seeds, f, &At::level_position_m);
          table.rows.push_back({world, std::string(1, letter), fault.name, options.filters[f]});
          for (Cell& cell : figures(seeds, f, without[f]))
            table.rows.back().push_back(std::move(cell));
        }
      }
    }
  }
  table.remarks.emplace_back(
      "bound: of the same seeds without the fault. median: over seeds. rejected: of the tags "
      "offered. dropped: tags removed, per seed.");
  table.remarks.emplace_back(
      "Saturated: 0.4 rad/s and 9.5 m/s2 per axis. Extrinsics: drawn, 5 deg and 5 cm in total, "
      "prior as wide. Pose at the images' own stamps.");
  return {table};
}

}  // namespace fiducap::bench
