// Many seeds of the simulator's classes: accuracy against the bound of each, consistency over time,
// divergence.
#include <fmt/format.h>

#include "estimation/ensemble.hpp"

namespace fiducap::bench {

namespace {

using At = FilterRun::At;

struct Group {
  const char* name;
  int degrees;
  double (*of)(const At&);
};
const Group kGroups[] = {{"pose", 6, [](const At& at) { return at.nees.pose; }},
                         {"vel", 3, [](const At& at) { return at.nees.velocity; }},
                         {"biases", 6, [](const At& at) { return at.nees.biases; }},
                         {"extr", 6, [](const At& at) { return at.nees.extrinsics; }},
                         {"tags", 6, [](const At& at) { return at.nees.tags; }}};

std::vector<Cell> accuracy_row(const std::vector<SeedRuns>& seeds, std::size_t f) {
  const auto pair = [&](double At::*error, double bound::BoundAt::*limit, double unit, int decimals,
                        std::vector<Cell>& row) {
    const double value = ensemble_rms(seeds, f, error);
    row.push_back(Figure{unit * value, decimals});
    row.push_back(Figure{value / ensemble_rms(seeds, limit), 2});
  };
  std::vector<Cell> row;
  pair(&At::position_m, &bound::BoundAt::position_m, kMm, 2, row);
  pair(&At::level_position_m, &bound::BoundAt::level_position_m, kMm, 2, row);
  pair(&At::rotation_rad, &bound::BoundAt::rotation_rad, kDegreesPerRadian, 3, row);
  pair(&At::velocity_m_s, &bound::BoundAt::velocity_m_s, kMm, 2, row);
  row.push_back(Figure{1e3 * ensemble_rms(seeds, f, &At::rate_rad_s), 2});
  const double map =
      ensemble_rms(seeds, [&](const SeedRuns& s) { return s.runs[f].near_map_position_m; });
  const double map_limit =
      ensemble_rms(seeds, [](const SeedRuns& s) { return s.bound.map.position_m; });
  row.push_back(Figure{map_limit > 0 ? kMm * map : Nees::kNone, 3});
  row.push_back(Figure{map_limit > 0 ? map / map_limit : Nees::kNone, 2});
  const bool closes = map_limit > 0 && seeds.front().bound.gap.has_value();
  const auto gap = [&](const std::function<double(const SeedRuns&)>& of) {
    return closes ? ensemble_rms(seeds, of) : Nees::kNone;
  };
  const double found = gap([&](const SeedRuns& s) { return s.runs[f].gap_m; });
  const double limit =
      gap([](const SeedRuns& s) { return s.bound.gap ? s.bound.gap->position_m : 0; });
  const double path = gap([&](const SeedRuns& s) { return s.runs[f].gap_path_m; });
  row.push_back(Figure{kMm * found, 1});
  row.push_back(Figure{found / limit, 2});
  row.push_back(Figure{100 * found / path, 3});
  int lost = 0;
  for (const SeedRuns& seed : seeds) lost += diverged(seed, f) ? 1 : 0;
  const Worst bad = worst(seeds, f);
  row.push_back(std::to_string(lost));
  row.push_back(fmt::format("{} ({:.2f})", bad.seed, bad.ratio));
  return row;
}

double nis_mean(const std::vector<SeedRuns>& seeds, std::size_t f, double from_s, double to_s,
                double& degrees) {
  double sum = 0;
  degrees = 0;
  for (const SeedRuns& seed : seeds) {
    for (const At& at : seed.runs[f].at) {
      if (at.t_s < from_s || at.t_s >= to_s) continue;
      sum += at.nis;
      degrees += at.nis_dof;
    }
  }
  return sum / degrees;
}

/// Over a window: mean per degree of freedom and, in brackets, the share of instants inside the
/// band.
std::vector<Cell> consistency_row(const std::vector<SeedRuns>& seeds, std::size_t f, double from_s,
                                  double to_s) {
  std::vector<Cell> row;
  for (const Group& group : kGroups) {
    const Consistency h = consistency(seeds, f, group.degrees, group.of, from_s, to_s);
    row.push_back(std::isnan(h.mean) ? "-"
                                     : fmt::format("{:.2f} ({:.0f})", h.mean, 100 * h.inside));
  }
  double degrees = 0;
  const double nis = nis_mean(seeds, f, from_s, to_s, degrees);
  const double width = 1.96 * std::sqrt(2 / degrees);
  row.push_back(fmt::format("{:.3f} [{:.3f} {:.3f}]", nis, 1 - width, 1 + width));
  return row;
}

/// One seed by itself.
std::vector<Cell> seed_row(const SeedRuns& seed, std::size_t f) {
  const FilterRun& run = seed.runs[f];
  const double position = run.rms([](const At& at) { return at.position_m; });
  const double limit = rms(seed.bound, seed.first, &bound::BoundAt::position_m);
  const double level = run.rms([](const At& at) { return at.level_position_m; });
  const double level_limit = rms(seed.bound, seed.first, &bound::BoundAt::level_position_m);
  return cells(seed.seed, Figure{kMm * position, 2}, Figure{position / limit, 2},
               Figure{kMm * level, 2}, Figure{level / level_limit, 2},
               Figure{run.mean([](const At& at) { return at.nees.pose / 6; }), 2},
               Figure{run.mean([](const At& at) { return at.nees.velocity / 3; }), 2},
               Figure{run.mean([](const At& at) { return at.nees.tags / 6; }), 2},
               Figure{run.gap_path_m > 0 ? kMm * run.gap_m : Nees::kNone, 1},
               Figure{seed.bound.gap ? run.gap_m / seed.bound.gap->position_m : Nees::kNone, 2},
               run.tags_rejected, run.tags_dropped, diverged(seed, f) ? "diverged" : "");
}

void append(std::vector<Cell>& row, std::vector<Cell> more) {
  row.insert(row.end(), more.begin(), more.end());
}

}  // namespace

std::vector<Table> bench_seeds(const EstimationOptions& options) {
  Table accuracy{
      fmt::format("{} seeds of each class from seed {}: RMSE over seeds and its ratio to the bound "
                  "over seeds (mm, deg, mm/s, mrad/s)",
                  options.seeds, options.first_seed),
      split("class|case|filter|pos|/bound|level|/bound|ori|/bound|vel|/bound|rate|map|/bound|gap|/"
            "bound|"
            "gap %|diverged|worst seed")};
  Table consistent{
      "NEES and NIS per degree of freedom over time: mean (per cent of instants with the mean over "
      "seeds in its 95 % band)",
      split("class|case|filter|seconds|pose|vel|biases|extr|tags|NIS [band]")};
  Table each{"Each seed (mm)",
             split("class|case|filter|seed|pos|/bound|level|/bound|pose NEES|vel|tags|gap|/bound|"
                   "rejected|dropped| ")};
  for (const std::string& world : options.classes) {
    const double seconds = seconds_of(options, world);
    for (const char letter : options.cases) {
      const auto seeds = run_seeds(options, letter, [&](std::uint64_t seed) {
        return simulate({.world = world, .seconds = seconds, .seed = seed});
      });
      for (std::size_t f = 0; f < options.filters.size(); ++f) {
        const std::vector<Cell> head{world, std::string(1, letter), options.filters[f]};
        accuracy.rows.push_back(head);
        append(accuracy.rows.back(), accuracy_row(seeds, f));
        for (const SeedRuns& seed : seeds) {
          each.rows.push_back(head);
          append(each.rows.back(), seed_row(seed, f));
        }
        const double window = (seconds - kSettled_s) / 5;
        for (int w = -1; w < 5; ++w) {
          const double from = w < 0 ? kSettled_s : kSettled_s + w * window;
          const double to = w < 0 ? seconds + 1 : from + window;
          consistent.rows.push_back(head);
          consistent.rows.back().push_back(w < 0 ? "all" : fmt::format("{:.0f}-{:.0f}", from, to));
          append(consistent.rows.back(), consistency_row(seeds, f, from, to));
        }
      }
    }
  }
  accuracy.remarks.push_back(
      "Limit over seeds: 1.25. diverged: over 5 bounds, or pose at under 90 % of the images with "
      "tags, or none at the end.");
  const auto text = [&](int degrees) {
    const Band band = band_of(degrees * options.seeds);
    return fmt::format("{} dof [{:.2f} {:.2f}]", degrees, band.low, band.high);
  };
  consistent.remarks.push_back(
      "95 % bands of the mean over seeds at one instant: " + text(6) + ", " + text(3) +
      ". Tags: mean over the tags in the state, band as for one tag. NIS is gated at 99.9 %.");
  if (options.each) return {accuracy, consistent, each};
  return {accuracy, consistent};
}

}  // namespace fiducap::bench
