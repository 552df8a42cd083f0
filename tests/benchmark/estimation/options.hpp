#pragma once

#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "estimation/table.hpp"
#include "simulation/filter_run.hpp"

namespace fiducap::bench {

/// What was asked for on the command line.
struct EstimationOptions {
  std::vector<std::string> filters;
  std::vector<std::string>
      classes;  ///< Simulated: table sparse loop hall big. Recordings: sim_table …
  std::string cases{"A"};
  std::vector<std::string> textures{"sharp"};  ///< Of the walls, where images are rendered.
  int seeds{10};
  std::uint64_t first_seed{1};
  double seconds{0};  ///< Of data per run; 0: as the class has it.
  std::string data;   ///< Folder with the recordings.
  int threads{2};
  bool quick{false};
  bool each{false};               ///< A line for every seed.
  bool without_imu{false};        ///< Of mismatch …
  bool graph{false};              ///< … also this: the map is refined.
  std::vector<std::string> only;  ///< Rows whose names begin like that; empty: all.
  EstimatorConfig estimator{};
};

inline constexpr double kSettled_s = 5.0;  ///< Figures start here.
inline constexpr double kMm = 1e3;
inline constexpr double kDegrees = 180 / std::numbers::pi;

/// Seconds of data that a class is judged by.
[[nodiscard]] inline double seconds_of(const EstimationOptions& options, const std::string& world) {
  if (options.seconds > 0) return options.seconds;
  if (world == "loop") return 124;
  return world == "big" ? 90 : 60;
}

[[nodiscard]] inline FilterChoice choice_of(const EstimationOptions& options,
                                            const std::string& filter, char letter) {
  FilterChoice choice;
  choice.filter = filter;
  choice.knowledge.letter = letter;
  choice.estimator = options.estimator;
  return choice;
}

/// Figure of the bound over its images after kSettled_s.
[[nodiscard]] inline double rms(const BoundRun& run, Instant first,
                                double bound::BoundAt::*figure) {
  double sum = 0;
  int count = 0;
  for (const bound::BoundAt& at : run.at) {
    if (to_seconds(at.at - first) < kSettled_s) continue;
    sum += at.*figure * at.*figure;
    ++count;
  }
  return count == 0 ? Nees::kNone : std::sqrt(sum / count);
}

// One file each.
[[nodiscard]] std::vector<Table> bench_classes(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_recordings(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_seeds(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_cpu(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_outages(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_live(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_branches(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_live_branches(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_faults(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_starloc(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_landmarks(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_lens(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_mismatch(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_sizes(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_moved(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_restart(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_growth(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_refined(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_ring(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_first_day(const EstimationOptions& options);

}  // namespace fiducap::bench
