// fiducap_bench map_store: commits every ten seconds of simulated time, with changes of all tags,
// on a disk in memory.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <vector>

#include "bench.hpp"
#include "mapping/store/map_store.hpp"
#include "support/fault_disk.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap::bench {
namespace {

struct StoreOptions {
  int tags{1000};
  double hours{24};
  bool keep{false};
};

double since_ms(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

int fill_store(const StoreOptions& options) {
  constexpr double kPeriod_s = 10;  // MapConfig::commit_period_s
  test::FaultDisk disk;
  auto store = MapStore::open("map");
  std::vector<int> ids;
  for (int id = 0; id < options.tags; ++id) ids.push_back(id);
  TagMap map = make_map(ids);
  const auto start = std::chrono::steady_clock::now();
  double worst_ms = 0;
  int commits = 0;
  for (double t = 0; t < options.hours * 3600; t += kPeriod_s, ++commits) {
    map.created_utc_ns += static_cast<std::int64_t>(kPeriod_s * 1e9);
    for (MapTag& entry : map.tags) {
      entry.tag.X_WT.p.x() += 1e-6;
      ++entry.sightings;
    }
    const auto began = std::chrono::steady_clock::now();
    auto stored = store->commit(map, kAutomaticComment);
    if (!stored || (!options.keep && !store->thin())) return 1;
    map = std::move(*stored);
    worst_ms = std::max(worst_ms, since_ms(began));
  }
  const double ms = since_ms(start) / commits;
  const auto versions = store->log()->size();
  const auto bytes = static_cast<double>(disk.content("map").size());
  std::printf(
      "%d tags, %.1f h, %d commits: %zu versions, %.1f MB (log beside it %.1f MB), "
      "%.0f kB per version, %.1f ms per commit, at most %.0f\n",
      options.tags, options.hours, commits, versions, 1e-6 * bytes,
      1e-6 * static_cast<double>(disk.content("map-wal").size()),
      1e-3 * bytes / static_cast<double>(versions), ms, worst_ms);
  return 0;
}

}  // namespace

Bench add_map_store(CLI::App& verb, const bool&) {
  const auto options = std::make_shared<StoreOptions>();
  verb.add_option("--tags", options->tags, "in the map");
  verb.add_option("--hours", options->hours, "simulated");
  verb.add_flag("--keep", options->keep, "all versions: nothing is thinned out");
  return [options] { return fill_store(*options); };
}

}  // namespace fiducap::bench
