// fiducap_estimation_bench: accuracy of the filters against the causal bound, the authors' code and
// each other. Without a verb: a little of each.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <iterator>

#include "base/log.hpp"
#include "estimation/options.hpp"
#include "support/shared_data.hpp"

namespace fiducap::bench {
namespace {

struct Verb {
  const char* name;
  const char* what;
  const char* classes;  ///< Between `|`.
  const char* cases;
  int seeds;
  std::vector<Table> (*run)(const EstimationOptions&);
};

constexpr Verb kVerbs[] = {
    {"recordings", "the open recordings against bound and authors' code", "table|sparse|loop|big",
     "ABCD", 1, bench_recordings},
    {"seeds", "simulated seeds: RMSE over bound, NEES, NIS, divergence", "table|sparse|loop", "A",
     10, bench_seeds},
    {"cpu", "CPU per second of data by local and by mapped tags", "", "A", 1, bench_cpu},
    {"outages", "1, 2 and 5 s without tags", "table|hall", "A", 10, bench_outages},
    {"faults", "wrong ids, occlusion, moved tags, wrong stamps, lost samples, …", "table|hall", "A",
     10, bench_faults},
    {"mismatch",
     "a world that differs from the configuration: errors against the same seeds without the "
     "difference",
     "table|sparse|loop", "A", 20, bench_mismatch},
    {"starloc", "real stereo runs with Vicon: clocks, and tag centres as measurements", "", "A", 1,
     bench_starloc},
    {"ring", "one map of several robots, each of which walks a part of a ring", "1|3", "A", 10,
     bench_ring},
    {"restart",
     "starts in a room that the map knows: time to the first pose, and changes of the map",
     "table|hall", "A", 60, bench_restart},
    {"moved",
     "tags that are moved (by metres), twice, on a door or of another size, also with a frozen "
     "map: verdicts, and false ones (--class: WHAT[-WORLD][-frozen])",
     "0.14|0.3|duplicate|duplicate-near|door|size|clean|0.14-frozen|0.3-frozen|duplicate-frozen|"
     "duplicate-near-frozen|door-frozen|size-frozen",
     "A", 5, bench_moved}};

void add_options(CLI::App& app, const Verb& verb, EstimationOptions& options) {
  options.classes = split(verb.classes);
  options.cases = verb.cases;
  options.seeds = verb.seeds;
  app.add_option("--filter", options.filters, "filters, side by side")
      ->check(CLI::IsMember({"robocentric", "world"}))
      ->delimiter(',');
  app.add_option("--class", options.classes, "classes of motion: table sparse loop hall hover big")
      ->delimiter(',');
  app.add_option("--cases", options.cases,
                 "of A B C D: unknown or true map, prior or true extrinsics");
  app.add_option("--seeds", options.seeds, "seeds per class")->check(CLI::Range(1, 10'000));
  app.add_option("--first-seed", options.first_seed, "the first of them");
  app.add_option("--seconds", options.seconds, "of data per run");
  app.add_option("--data", options.data, "folder with sim_table, sim_sparse, …");
  app.add_flag("--each", options.each, "a line for every seed");
  app.add_flag("--without-imu", options.without_imu, "mismatch: bodies with a camera alone");
  app.add_flag("!--exact", options.estimator.doubt_configuration,
               "all configured values are exact");
  app.add_flag("--refine", options.estimator.refine_intrinsics, "lenses are refined");
  app.add_option("--only", options.only, "rows of mismatch that begin like this: \"prints;door\"")
      ->delimiter(';');
  app.add_option("--threads", options.threads, "at once")->check(CLI::Range(1, 64));
}

/// A little of everything, within a minute.
std::vector<Table> run_quick(const EstimationOptions& base) {
  std::vector<Table> tables;
  for (const Verb& verb : kVerbs) {
    // Take a minute by themselves.
    if (verb.run == bench_starloc || verb.run == bench_ring || verb.run == bench_moved) continue;
    EstimationOptions options = base;
    options.quick = true;
    options.classes = {"table"};
    options.cases = "A";
    options.seeds = 2;
    for (Table& table : verb.run(options)) tables.push_back(std::move(table));
  }
  return tables;
}

void print(const std::vector<Table>& tables, bool json) {
  if (json) {
    std::puts(to_json(tables).c_str());
    return;
  }
  for (const Table& table : tables) std::fputs(to_text(table).c_str(), stdout);
}

int run(int argc, char** argv) {
  CLI::App app{"The filters: accuracy against the bound, consistency, cost, faults"};
  bool json = false;
  app.add_flag("--json", json, "tables as JSON")->configurable(false);
  app.fallthrough();
  EstimationOptions base;
  base.filters = {"world"};
  if (const auto folder = shared_data()) base.data = folder->string();
  std::vector<EstimationOptions> options(std::size(kVerbs), base);
  std::vector<CLI::App*> commands;
  for (std::size_t i = 0; i < std::size(kVerbs); ++i) {
    commands.push_back(app.add_subcommand(kVerbs[i].name, kVerbs[i].what));
    add_options(*commands.back(), kVerbs[i], options[i]);
  }
  app.require_subcommand(0, 1);
  CLI11_PARSE(app, argc, argv);
  log::set_level(log::Level::kError);
  for (std::size_t i = 0; i < commands.size(); ++i) {
    if (!commands[i]->parsed()) continue;
    print(kVerbs[i].run(options[i]), json);
    return 0;
  }
  print(run_quick(base), json);
  return 0;
}

}  // namespace
}  // namespace fiducap::bench

int main(int argc, char** argv) { return fiducap::bench::run(argc, argv); }
