// fiducap_paper_bench: every experiment of the paper, rendered, detected and filtered by this code,
// both filters side by side.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>

#include "base/log.hpp"
#include "base/whole_file.hpp"
#include "estimation/table.hpp"
#include "paper/paper_run.hpp"

namespace fiducap::bench {
namespace {

struct Experiment {
  const char* name;
  PaperResult (*run)(const PaperOptions&);
};
constexpr Experiment kExperiments[] = {
    {"table", table_experiment}, {"dataset_1", dataset_1_experiment},
    {"cube", cube_experiment},   {"pavillon", pavillon_experiment},
    {"hall", hall_experiment},   {"extrinsics", extrinsics_experiment}};

/// "0.21 (0.42)": RMS over the runs, in brackets the worst; "!" where the goal is missed.
std::string text_of(const PaperFigure& figure, const Spread& ours, int repeats) {
  if (std::isnan(ours.rms)) return "failed !";
  std::string out = fmt::format("{:.{}f}", ours.rms, figure.decimals);
  if (repeats > 1) out += fmt::format(" ({:.{}f})", ours.worst, figure.decimals);
  return out + (figure.goal > 0 && ours.rms > figure.goal ? " !" : "");
}

Table table_of(const std::vector<PaperResult>& results, const PaperOptions& options) {
  Table table;
  table.title = fmt::format(
      "Experiments of the paper, simulated: {} run{} each, RMS over runs (worst in brackets); "
      "camera "
      "752x480 at 20 Hz, IMU at 200 Hz, images rendered and searched, defaults throughout",
      options.repeats(), options.repeats() == 1 ? "" : "s");
  table.columns = {"experiment", "figure", "unit", "paper", "authors' code"};
  for (const std::string& filter : options.filters) table.columns.push_back("ours " + filter);
  table.columns.emplace_back("goal");
  for (const PaperResult& result : results) {
    for (const PaperFigure& figure : result.figures) {
      std::vector<Cell> row{result.experiment, figure.what, figure.unit, figure.paper,
                            figure.authors};
      for (const Spread& ours : figure.ours)
        row.emplace_back(text_of(figure, ours, options.repeats()));
      row.emplace_back(figure.goal > 0 ? fmt::format("≤ {:g}", figure.goal) : "");
      table.rows.push_back(std::move(row));
    }
    for (const std::string& remark : result.remarks)
      table.remarks.push_back(result.experiment + ": " + remark);
  }
  return table;
}

/// A page per experiment.
bool write_plots(const std::vector<PaperResult>& results, const std::string& folder) {
  for (const PaperResult& result : results) {
    const auto file = (std::filesystem::path(folder) / (result.experiment + ".html")).string();
    const PlotPage page{result.experiment, result.remarks, result.plots, {}};
    if (const auto written = write_whole_file(file, to_html(page)); !written) {
      std::fprintf(stderr, "%s\n", written.error().text().c_str());
      return false;
    }
  }
  return true;
}

int run(int argc, char** argv) {
  CLI::App app{"The paper's experiments on the simulator: paper, authors' code and ours"};
  PaperOptions options;
  std::vector<std::string> only;
  std::string plots;
  bool json = false;
  std::vector<std::string> names;
  for (const Experiment& experiment : kExperiments) names.emplace_back(experiment.name);
  app.add_flag("--quick", options.quick, "one short run each");
  app.add_option("--only", only, "these experiments")->check(CLI::IsMember(names))->delimiter(',');
  app.add_option("--plots", plots, "folder for the plots, a page (.html) per experiment");
  app.add_option("--runs", options.runs, "of each experiment")->check(CLI::Range(1, 1000));
  app.add_option("--first-seed", options.first_seed, "the first of them");
  app.add_option("--threads", options.threads, "at once")->check(CLI::Range(1, 64));
  app.add_option("--filter", options.filters, "filters, side by side")
      ->check(CLI::IsMember({"robocentric", "world"}))
      ->delimiter(',');
  app.add_option("--corner-noise", options.estimator.corner_noise_px,
                 "sigma of corners in the filters, px (default: as the server)")
      ->check(CLI::Range(1e-3, 10.0));
  app.add_flag("--json", json, "the table as JSON");
  CLI11_PARSE(app, argc, argv);
  log::set_level(log::Level::kError);
  std::vector<PaperResult> results;
  for (const Experiment& experiment : kExperiments) {
    if (!only.empty() && std::find(only.begin(), only.end(), experiment.name) == only.end())
      continue;
    std::fprintf(stderr, "%s …\n", experiment.name);
    results.push_back(experiment.run(options));
  }
  Table table = table_of(results, options);
  table.remarks.push_back(
      fmt::format("CPU time: {:.0f} s", static_cast<double>(std::clock()) / CLOCKS_PER_SEC));
  std::fputs((json ? to_json({table}) + "\n" : to_text(table)).c_str(), stdout);
  return plots.empty() || write_plots(results, plots) ? 0 : 1;
}

}  // namespace
}  // namespace fiducap::bench

int main(int argc, char** argv) { return fiducap::bench::run(argc, argv); }
