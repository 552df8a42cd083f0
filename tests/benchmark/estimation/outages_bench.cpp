// Images without tags for some seconds: drift of the pose, its sigma, and the time of recovery.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "estimation/ensemble.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/options.hpp"
#include "simulation/mismatch_changes.hpp"

namespace fiducap::bench {

namespace {

using At = FilterRun::At;

constexpr double kEvery_s = 12.0;    // an outage begins at each multiple
constexpr double kBefore_s = 2.0;    // what the error is compared with
constexpr double kRecovery_s = 5.0;  // observed time
constexpr double kRecovered = 1.25;  // RMS over outages, of what it was before

/// All outages of all seeds.
struct Outages {
  MeanSquare position, rotation, velocity, sigma, bound, before;
  int covered{};
  std::vector<MeanSquare> after;  ///< By image since the return.
  [[nodiscard]] double recovery_s() const {
    for (std::size_t i = 0; i < after.size(); ++i) {
      if (after[i].rms() <= kRecovered * before.rms()) return 0.05 * static_cast<double>(i);
    }
    return Nees::kNone;
  }
};

const bound::BoundAt* bound_at(const SeedRuns& seed, double t_s) {
  const Instant at = seed.first + from_seconds(t_s);
  const auto found = std::lower_bound(seed.bound.at.begin(), seed.bound.at.end(),
                                      at - std::chrono::microseconds(1),
                                      [](const bound::BoundAt& b, Instant i) { return b.at < i; });
  return found == seed.bound.at.end() ? nullptr : &*found;
}

void add_outage(Outages& all, const SeedRuns& seed, const FilterRun& run, double begin_s,
                double length_s) {
  static const double kCovered = chi_square_quantile(6, 0.95);
  const At* last = nullptr;
  for (const At& at : run.at) {
    if (at.t_s >= begin_s - kBefore_s && at.t_s < begin_s) all.before.add(at.level_position_m);
    if (at.t_s >= begin_s && at.t_s < begin_s + length_s) last = &at;
    const double since_s = at.t_s - (begin_s + length_s);
    if (since_s < 0 || since_s >= kRecovery_s) continue;
    const auto image = static_cast<std::size_t>(since_s / 0.05);
    if (image < all.after.size()) all.after[image].add(at.level_position_m);
  }
  if (last == nullptr) return;
  all.position.add(last->level_position_m);
  all.rotation.add(last->level_rotation_rad);
  all.velocity.add(last->velocity_m_s);
  all.sigma.add(last->sigma_m);
  all.covered += last->nees.pose < kCovered ? 1 : 0;
  if (const auto* limit = bound_at(seed, last->t_s)) all.bound.add(limit->level_position_m);
}

Outages gather(const std::vector<SeedRuns>& seeds, std::size_t filter, double seconds,
               double length_s) {
  Outages all;
  all.after.resize(static_cast<std::size_t>(kRecovery_s / 0.05));
  for (const SeedRuns& seed : seeds) {
    for (double begin_s = kEvery_s; begin_s + length_s + kRecovery_s < seconds;
         begin_s += kEvery_s) {
      add_outage(all, seed, seed.runs[filter], begin_s, length_s);
    }
  }
  return all;
}

}  // namespace

std::vector<Table> bench_outages(const EstimationOptions& options) {
  Table table{fmt::format("Outages every {:.0f} s, {} seeds: at the last image without tags (mm, "
                          "deg, mm/s), RMS over outages",
                          kEvery_s, options.seeds),
              split("class|case|filter|length s|outages|pos|bound|/bound|sigma|covered %|ori|vel|"
                    "before|recovery s")};
  const std::vector<double> lengths = options.quick ? std::vector{2.0} : std::vector{1.0, 2.0, 5.0};
  for (const std::string& world : options.classes) {
    const double seconds = seconds_of(options, world);
    for (const char letter : options.cases) {
      for (const double length_s : lengths) {
        const auto seeds = run_seeds(options, letter, [&](std::uint64_t seed) {
          EstimationData data = simulate({.world = world, .seconds = seconds, .seed = seed});
          mismatch::blind(data, kEvery_s, length_s);
          return data;
        });
        for (std::size_t f = 0; f < options.filters.size(); ++f) {
          const Outages all = gather(seeds, f, seconds, length_s);
          const double ends = std::max(1, all.position.count);
          table.rows.push_back(cells(
              world, std::string(1, letter), options.filters[f], Figure{length_s, 0},
              all.position.count, Figure{kMm * all.position.rms(), 1},
              Figure{kMm * all.bound.rms(), 1}, Figure{all.position.rms() / all.bound.rms(), 2},
              Figure{kMm * all.sigma.rms(), 1}, Figure{100 * all.covered / ends, 1},
              Figure{kDegreesPerRadian * all.rotation.rms(), 3},
              Figure{kMm * all.velocity.rms(), 1}, Figure{kMm * all.before.rms(), 2},
              Figure{all.recovery_s(), 2}));
        }
      }
    }
  }
  table.remarks.emplace_back(
      "Level axes at the reference tag. covered: pose inside its own 95 % ellipsoid. before: error "
      "of the 2 s before.");
  table.remarks.emplace_back(
      "recovery: from the first image with tags until the RMS over outages is within 1.25 of "
      "before; -: not within 5 s.");
  return {table};
}

}  // namespace fiducap::bench
