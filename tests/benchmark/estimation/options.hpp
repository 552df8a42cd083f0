#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "base/numeric.hpp"
#include "estimation/table.hpp"
#include "simulation/filter_run.hpp"

namespace fiducap::bench {

/// Options of the command line.
struct EstimationOptions {
  std::vector<std::string> filters;
  std::vector<std::string> classes;  ///< Simulated: table sparse loop … Recordings: sim_table …
  std::string cases{"A"};
  int seeds{10};
  std::uint64_t first_seed{1};
  double seconds{0};  ///< Of data per run; 0: as the class has it.
  std::string data;   ///< Folder with the recordings.
  int threads{2};
  bool quick{false};
  bool each{false};               ///< A line for every seed.
  bool without_imu{false};        ///< Of mismatch.
  std::vector<std::string> only;  ///< Rows whose names begin like that; empty: all.
  EstimatorConfig estimator{};

  [[nodiscard]] bool includes(const std::string& row) const {
    return only.empty() || std::any_of(only.begin(), only.end(), [&](const std::string& begin) {
             return row.starts_with(begin);
           });
  }
  [[nodiscard]] std::uint64_t last_seed() const {
    return first_seed + static_cast<std::uint64_t>(seeds) - 1;
  }
};

inline constexpr double kSettled_s = 5.0;  ///< Figures start here.
inline constexpr double kMm = 1e3;

/// Seconds of data of a class.
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

/// Calls work(0) … work(count − 1), each once, on several threads. Calls must not write to the same
/// data.
inline void in_parallel(int count, int threads, const std::function<void(int)>& work) {
  std::atomic<int> next{0};
  const auto take = [&] {
    for (int i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::jthread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(take);
  take();
}

/// Calls run(seed) for every seed, some at once. @return the results, by seed
template <typename Run>
[[nodiscard]] auto for_seeds(const EstimationOptions& options, Run&& run) {
  std::vector<std::invoke_result_t<Run&, std::uint64_t>> results(
      static_cast<std::size_t>(options.seeds));
  in_parallel(options.seeds, options.threads, [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    results[k] = run(options.first_seed + k);
  });
  return results;
}

/// Robots in one room: motion and noise differ, the reference tag is the same.
[[nodiscard]] inline std::vector<EstimationData> robots_of(
    int count, std::uint64_t seed,
    const std::function<EstimationData(int robot, std::uint64_t seed)>& data_of) {
  constexpr std::uint64_t kApart = 10'000;
  std::vector<EstimationData> robots;
  for (int k = 0; k < count; ++k)
    robots.push_back(data_of(k, seed + kApart * static_cast<std::uint64_t>(k)));
  for (EstimationData& robot : robots) robot.reference_tag = robots.front().reference_tag;
  return robots;
}

/// The middle of the known values, the upper one of two; NaN without any.
[[nodiscard]] inline double median(std::vector<double> values) {
  std::erase_if(values, [](double x) { return std::isnan(x); });
  if (values.empty()) return Nees::kNone;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The largest of the known values; NaN without any.
[[nodiscard]] inline double largest(const std::vector<double>& values) {
  double most = Nees::kNone;
  for (const double x : values)
    if (!std::isnan(x) && !(x <= most)) most = x;
  return most;
}

// One file each.
[[nodiscard]] std::vector<Table> bench_recordings(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_seeds(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_cpu(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_outages(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_faults(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_starloc(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_mismatch(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_moved(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_restart(const EstimationOptions& options);
[[nodiscard]] std::vector<Table> bench_ring(const EstimationOptions& options);

}  // namespace fiducap::bench
