#include "estimation/ensemble.hpp"

#include <cmath>
#include <map>

#include "estimation/filter/chi_square.hpp"

namespace fiducap::bench {

std::vector<SeedRuns> run_seeds(const EstimationOptions& options, char letter,
                                const std::function<EstimationData(std::uint64_t)>& data_of,
                                const std::function<EstimationData(std::uint64_t)>& bound_data_of) {
  return for_seeds(options, [&](std::uint64_t seed) {
    SeedRuns one;
    one.seed = seed;
    const EstimationData data = data_of(seed);
    one.first = time_of(data.samples.front());
    one.bound = run_bound(bound_data_of ? bound_data_of(seed) : data, {letter});
    for (const std::string& filter : options.filters)
      one.runs.push_back(
          run_filter(data, choice_of(options, filter, letter)).scored_after(kSettled_s));
    return one;
  });
}

double ensemble_rms(const std::vector<SeedRuns>& seeds,
                    const std::function<double(const SeedRuns&)>& of) {
  MeanSquare sum;
  for (const SeedRuns& seed : seeds) sum.add(of(seed));
  return sum.rms();
}

double ensemble_rms(const std::vector<SeedRuns>& seeds, std::size_t filter,
                    double FilterRun::At::*figure) {
  return ensemble_rms(seeds, [&](const SeedRuns& seed) {
    return seed.runs[filter].rms([&](const auto& at) { return at.*figure; });
  });
}

double ensemble_rms(const std::vector<SeedRuns>& seeds, double bound::BoundAt::*figure) {
  return ensemble_rms(seeds,
                      [&](const SeedRuns& seed) { return rms(seed.bound, seed.first, figure); });
}

namespace {

double ratio(const SeedRuns& seed, std::size_t filter) {
  const double error = seed.runs[filter].rms([](const auto& at) { return at.position_m; });
  return error / rms(seed.bound, seed.first, &bound::BoundAt::position_m);
}

}  // namespace

bool diverged(const SeedRuns& seed, std::size_t filter) {
  const FilterRun& run = seed.runs[filter];
  if (run.at.empty() || run.frames_with_pose < 0.9 * run.frames_with_tags) return true;
  if (run.at.back().t_s < run.seconds - 1.0) return true;
  return !(ratio(seed, filter) < kLostFactor);
}

Worst worst(const std::vector<SeedRuns>& seeds, std::size_t filter) {
  Worst out;
  for (const SeedRuns& seed : seeds) {
    const double one = ratio(seed, filter);
    if (!(one <= out.ratio)) out = {seed.seed, one};
    if (std::isnan(one)) break;
  }
  return out;
}

Consistency consistency(const std::vector<SeedRuns>& seeds, std::size_t filter, int degrees,
                        const std::function<double(const FilterRun::At&)>& of, double from_s,
                        double to_s) {
  struct Sum {
    double value{};
    int count{};
  };
  std::map<long, Sum> by_instant;  // of all seeds, to the millisecond
  Sum all;
  for (const SeedRuns& seed : seeds) {
    for (const FilterRun::At& at : seed.runs[filter].at) {
      const double value = of(at);
      if (std::isnan(value) || at.t_s < from_s || at.t_s >= to_s) continue;
      Sum& instant = by_instant[std::lround(1e3 * at.t_s)];
      instant.value += value;
      ++instant.count;
      all.value += value;
      ++all.count;
    }
  }
  if (all.count == 0) return {Nees::kNone, Nees::kNone};
  int inside = 0;
  for (const auto& [instant, sum] : by_instant) {
    const Band band = band_of(degrees * sum.count);
    const double mean = sum.value / (degrees * sum.count);
    inside += mean >= band.low && mean <= band.high ? 1 : 0;
  }
  return {all.value / (degrees * all.count),
          static_cast<double>(inside) / static_cast<double>(by_instant.size())};
}

Band band_of(int degrees) {
  return {chi_square_quantile(degrees, 0.025) / degrees,
          chi_square_quantile(degrees, 0.975) / degrees};
}

}  // namespace fiducap::bench
