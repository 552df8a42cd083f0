// Wrong tag sizes: whether the size check reports them, of which tags, when, and its false reports.
#include <fmt/format.h>

#include <algorithm>

#include "estimation/options.hpp"
#include "simulation/size_run.hpp"

namespace fiducap::bench {

namespace {

using simulation::FaultConfig;

// Deviations below this are not a misprint (and never made here).
constexpr double kMisprinted = 0.03;

std::vector<Misprint> misprints(bool has_imu) {
  std::vector<Misprint> all{
      {"right", 1, 1},
      {"all 1.25", 1.25, 1},
      {"all 1.10", 1.10, 1},
      {"all 0.90", 0.90, 1},
      {"all 0.80", 0.8, 1},
      {"one 1.25", 1, 1.25},
      {"one 1.10", 1, 1.10},
      {"one 0.90", 1, 0.90},
      {"1 % wrong ids", 1, 1, [](FaultConfig& f, int, double) { f.wrong_id = 0.01; }},
      {"10 % covered", 1, 1, [](FaultConfig& f, int, double) { f.occlude_corner = 0.1; }},
      {"tag moved 0.3 m", 1, 1,
       [](FaultConfig& f, int tag, double seconds) {
         f.moved_tag = tag;
         f.moved_at_s = 0.5 * seconds;
         f.moved_by_m = {0.2, 0.2, 0.1};
       }},
      {"images +50 ms", 1, 1, [](FaultConfig& f, int, double) { f.image_stamp_error_s = 0.05; }},
      {"images -50 ms", 1, 1, [](FaultConfig& f, int, double) { f.image_stamp_error_s = -0.05; }},
      {"IMU loss, jitter", 1, 1,
       [](FaultConfig& f, int, double) {
         f.drop_imu = 0.05;
         f.imu_stamp_jitter_s = 0.002;
       }},
      {"saturated 3 s", 1, 1, [](FaultConfig& f, int, double seconds) {
         f.saturation_at_s = 0.5 * seconds;
         f.saturation_s = 3.0;
       }}};
  constexpr std::size_t kNeedImu = 4;  // the last ones
  if (!has_imu) all.resize(all.size() - kNeedImu);
  return all;
}

/// printed / configured size, of the tags of a finding
double truth_of(const SizeRun& run, const Misprint& misprint, const SizeFinding& finding) {
  if (!finding.tag_id) return misprint.all;
  return *finding.tag_id == run.tag ? misprint.all * misprint.one : misprint.all;
}

struct Counts {
  int right{}, of_all{}, of_one{}, wrong{}, rejection{};
  double rejected{}, judged{};
  std::vector<double> first_s, ratio;
};

void count(const SizeRun& run, const Misprint& misprint, Counts& counts) {
  bool right = false, wrong = false, of_all = false, of_one = false;
  for (const auto& [at_s, finding] : run.said) {
    const double truth = std::log(truth_of(run, misprint, finding));
    const bool is_right = std::abs(truth) > kMisprinted && truth * std::log(finding.ratio) > 0;
    if (is_right && !right) counts.first_s.push_back(at_s);
    (is_right ? right : wrong) = true;
    (finding.tag_id ? of_one : of_all) = true;
  }
  if (right) counts.ratio.push_back(run.said.back().finding.ratio);
  counts.right += right;
  counts.wrong += wrong;
  counts.of_all += of_all;
  counts.of_one += of_one;
  counts.rejection += run.rejection_said_at_s.empty() ? 0 : 1;
  counts.rejected += run.rejected;
  counts.judged += run.used + run.rejected;
}

std::string text(const std::optional<LogScale>& scale) {
  return scale ? fmt::format("{:.3f} ± {:.3f}", std::exp(scale->value), scale->sigma) : "–";
}

void print_run(const std::string& what, int seed, const SizeRun& run) {
  fmt::print("{} seed {}: all {}, tag {} by IMU {}, against the others {}:", what, seed,
             text(run.common), run.tag, text(run.by_imu), text(run.by_others));
  for (const auto& [at_s, finding] : run.said)
    fmt::print(" [{:.0f} s {} {:.3f}]", at_s,
               finding.tag_id ? std::to_string(*finding.tag_id) : "all", finding.ratio);
  for (const double at_s : run.rejection_said_at_s) fmt::print(" [{:.0f} s rejections]", at_s);
  fmt::print("\n");
}

std::vector<Cell> row(const EstimationOptions& options, const std::string& world, bool has_imu,
                      const std::string& filter, const Misprint& misprint) {
  const auto runs = for_seeds(options, [&](std::uint64_t seed) {
    const double seconds = seconds_of(options, world);
    return run_sizes({.world = world, .seconds = seconds, .seed = seed, .has_imu = has_imu}, filter,
                     misprint);
  });
  Counts counts;
  int seed = static_cast<int>(options.first_seed);
  for (const SizeRun& run : runs) {
    count(run, misprint, counts);
    if (options.each)
      print_run(world + (has_imu ? ", " : " without IMU, ") + misprint.name, seed++, run);
  }
  return cells(world, has_imu ? "yes" : "no", filter, misprint.name, counts.right, counts.of_all,
               counts.of_one, counts.wrong, Figure{median(counts.first_s), 0},
               Figure{median(counts.ratio), 3}, counts.rejection,
               Figure{100 * counts.rejected / std::max(1.0, counts.judged), 1});
}

}  // namespace

std::vector<Table> bench_sizes(const EstimationOptions& options) {
  Table table{fmt::format("Printed against configured tag sizes, {} seeds: runs with reports",
                          options.seeds),
              split("class|IMU|filter|printed/configured|rightly|of all|of one tag|wrongly|first s|"
                    "reported ratio|rejections reported|rejected %")};
  for (const std::string& world : options.classes) {
    for (const bool has_imu : {true, false}) {
      for (const std::string& filter : options.filters) {
        for (const Misprint& misprint : misprints(has_imu))
          table.rows.push_back(row(options, world, has_imu, filter, misprint));
      }
    }
  }
  table.remarks.emplace_back(
      "rightly: at least one warning of a misprinted tag (or of all), with the right sign. first "
      "s, reported ratio: medians of first and last such warning. one: the tag seen most.");
  return {table};
}

}  // namespace fiducap::bench
