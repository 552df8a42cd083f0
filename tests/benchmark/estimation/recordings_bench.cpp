// The open recordings: one run of each filter in each case, beside the bound and the authors' code.
#include <map>

#include "estimation/options.hpp"

namespace fiducap::bench {

namespace {

/// The authors' code, default settings (research/rcars_study.md, section d).
struct Rcars {
  double position_mm, rotation_deg, velocity_mm_s, map_mm;
};
constexpr double kNotRun = Nees::kNone;
const std::map<std::string, Rcars> kRcars{
    {"sim_table A", {18.0, 0.30, 16, 1.2}},     {"sim_table B", {4.2, 0.17, 11, 1.4}},
    {"sim_table C", {19.9, 0.18, 15, kNotRun}}, {"sim_sparse A", {48.3, 0.57, 36, 55}},
    {"sim_sparse B", {45.2, 0.56, 33, 54}},     {"sim_sparse C", {21.1, 0.35, 34, kNotRun}},
    {"sim_loop A", {3980, 21.1, 54, 4300}},     {"sim_loop C", {23.7, 0.30, 15, kNotRun}},
    {"sim_loop D", {4.6, 0.09, 17, kNotRun}},   {"sim_big A", {530, 1.31, 150, kNotRun}},
    {"sim_big C", {14.1, 0.20, 20, kNotRun}},   {"sim_big D", {6.0, 0.08, 17, kNotRun}}};

Rcars rcars_of(const std::string& name, char letter) {
  const auto found = kRcars.find(name + " " + letter);
  return found == kRcars.end() ? Rcars{kNotRun, kNotRun, kNotRun, kNotRun} : found->second;
}

struct Job {
  const EstimationData* data{};
  char letter{};
  BoundRun bound{};
  std::vector<FilterRun> runs{};
};

std::vector<Cell> row_of(const Job& job, const std::string& filter, const FilterRun& whole) {
  const FilterRun run = whole.scored_after(kSettled_s);
  const Instant first = time_of(job.data->samples.front());
  const auto of = [&](double FilterRun::At::*figure) {
    return run.rms([&](const auto& at) { return at.*figure; });
  };
  const auto limit = [&](double bound::BoundAt::*figure) { return rms(job.bound, first, figure); };
  const double position = of(&FilterRun::At::position_m);
  const double level = of(&FilterRun::At::level_position_m);
  const double rotation = of(&FilterRun::At::rotation_rad);
  const double velocity = of(&FilterRun::At::velocity_m_s);
  const Rcars authors = rcars_of(job.data->name, job.letter);
  const bool maps = job.letter < 'C';
  const bool closes = run.gap_path_m > 0 && job.bound.gap && maps;
  const auto known = [](bool is, double value) { return is ? value : Nees::kNone; };
  return cells(job.data->name, std::string(1, job.letter), filter, Figure{kMm * position, 2},
               Figure{position / limit(&bound::BoundAt::position_m), 2}, Figure{kMm * level, 2},
               Figure{level / limit(&bound::BoundAt::level_position_m), 2},
               Figure{kDegreesPerRadian * rotation, 3},
               Figure{rotation / limit(&bound::BoundAt::rotation_rad), 2},
               Figure{kMm * velocity, 2},
               Figure{velocity / limit(&bound::BoundAt::velocity_m_s), 2},
               Figure{1e3 * of(&FilterRun::At::rate_rad_s), 2},
               Figure{known(maps, kMm * run.near_map_position_m), 3},
               Figure{known(maps, run.near_map_position_m / job.bound.map.position_m), 2},
               Figure{known(closes, kMm * run.gap_m), 1},
               Figure{known(closes, 100 * run.gap_m / run.gap_path_m), 3},
               Figure{run.mean([](const auto& at) { return at.nees.pose / 6; }), 2},
               Figure{authors.position_mm, 1}, Figure{kMm * position / authors.position_mm, 3});
}

}  // namespace

std::vector<Table> bench_recordings(const EstimationOptions& options) {
  Table table{
      "Open simulated recordings, nominal extrinsics, one run each (mm, deg, mm/s, mrad/s)",
      split(
          "recording|case|filter|pos|/bound|level|/bound|ori|/bound|vel|/bound|rate|map|/bound|gap|"
          "gap %|NEES/dof|RCARS pos|/RCARS")};
  std::vector<EstimationData> all;
  for (const std::string& name : options.classes) {
    auto data = load_estimation_data(options.data + "/sim_" + name);
    if (data) {
      all.push_back(std::move(*data));
    } else {
      table.remarks.emplace_back("NOT RUN: " + data.error().text());
    }
  }
  std::vector<Job> jobs;
  for (const EstimationData& data : all) {
    for (const char letter : options.cases) jobs.push_back({&data, letter});
  }
  in_parallel(static_cast<int>(jobs.size()), options.threads, [&](int i) {
    Job& job = jobs[static_cast<std::size_t>(i)];
    job.bound = run_bound(*job.data, {job.letter});
    for (const std::string& filter : options.filters)
      job.runs.push_back(run_filter(*job.data, choice_of(options, filter, job.letter)));
  });
  for (const Job& job : jobs) {
    for (std::size_t f = 0; f < options.filters.size(); ++f)
      table.rows.push_back(row_of(job, options.filters[f], job.runs[f]));
  }
  table.remarks.emplace_back(
      "pos, ori: in the reference tag's axes; level: gravity-levelled at that tag; vel, rate: body "
      "axes; from 5 s on.");
  table.remarks.emplace_back(
      "Limits for one run: 2.2 in A to C, 1.3 in D. Loop gap: bound 0.13 % of the path. RCARS loop "
      "A with the right branch forced: 216 mm.");
  return {table};
}

}  // namespace fiducap::bench
