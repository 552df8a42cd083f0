#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "estimation/options.hpp"

namespace fiducap::bench {

/// Root of the mean square of the added values; NaN without any.
struct MeanSquare {
  double square{};
  int count{};
  void add(double value) {
    square += value * value;
    ++count;
  }
  [[nodiscard]] double rms() const { return count == 0 ? Nees::kNone : std::sqrt(square / count); }
};

/// One seed: the bound and one run per filter over the same data.
struct SeedRuns {
  std::uint64_t seed{};
  Instant first{};
  BoundRun bound;
  std::vector<FilterRun> runs;
};

/// Simulates each seed once and runs bound and filters over it.
/// @param bound_data_of  data of the bound, e.g. without the fault; nullptr: the same
[[nodiscard]] std::vector<SeedRuns> run_seeds(
    const EstimationOptions& options, char letter,
    const std::function<EstimationData(std::uint64_t)>& data_of,
    const std::function<EstimationData(std::uint64_t)>& bound_data_of = nullptr);

/// Root of the mean square over seeds: of any figure, of one of a filter's run, of one of the
/// bound.
[[nodiscard]] double ensemble_rms(const std::vector<SeedRuns>& seeds,
                                  const std::function<double(const SeedRuns&)>& of);
[[nodiscard]] double ensemble_rms(const std::vector<SeedRuns>& seeds, std::size_t filter,
                                  double FilterRun::At::*figure);
[[nodiscard]] double ensemble_rms(const std::vector<SeedRuns>& seeds,
                                  double bound::BoundAt::*figure);

/// Lost: more than kLostFactor times its bound, pose at less than nine tenths of the images with
/// tags, or none at the end.
inline constexpr double kLostFactor = 5.0;
[[nodiscard]] bool diverged(const SeedRuns& seed, std::size_t filter);

struct Worst {
  std::uint64_t seed{};
  double ratio{};  ///< Of its position RMSE to its bound.
};
[[nodiscard]] Worst worst(const std::vector<SeedRuns>& seeds, std::size_t filter);

/// Mean of a normalised squared error per degree of freedom, and how often the mean over seeds is
/// in its band.
struct Consistency {
  double mean{};
  double inside{};  ///< Share of the instants.
};
/// @param of    figure of one image, NaN where unknown
/// @param from, to  seconds since the first sample
[[nodiscard]] Consistency consistency(const std::vector<SeedRuns>& seeds, std::size_t filter,
                                      int degrees,
                                      const std::function<double(const FilterRun::At&)>& of,
                                      double from_s, double to_s);
/// 95 % band per degree of freedom of a chi-square variable.
struct Band {
  double low, high;
};
[[nodiscard]] Band band_of(int degrees);

}  // namespace fiducap::bench
