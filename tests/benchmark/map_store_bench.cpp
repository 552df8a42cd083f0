// How large a map store becomes: fiducap_map_store_bench [TAGS [HOURS [keep]]]. Commits every ten
// seconds of simulated time, every tag changed, on a disk in memory. `keep`: nothing is thinned
// out.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "mapping/store/map_store.hpp"
#include "support/fault_disk.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace {

constexpr double kPeriod_s = 10;  // MapConfig::commit_period_s

double since_ms(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

}  // namespace

int main(int argc, char** argv) {
  using namespace fiducap;
  const int tags = argc > 1 ? std::atoi(argv[1]) : 1000;
  const double hours = argc > 2 ? std::atof(argv[2]) : 24;
  const bool thin = argc <= 3 || std::string(argv[3]) != "keep";
  test::FaultDisk disk;
  auto store = MapStore::open("map");
  std::vector<int> ids;
  for (int id = 0; id < tags; ++id) ids.push_back(id);
  TagMap map = make_map(ids);
  const auto start = std::chrono::steady_clock::now();
  double worst_ms = 0;
  int commits = 0;
  for (double t = 0; t < hours * 3600; t += kPeriod_s, ++commits) {
    map.created_utc_ns += static_cast<std::int64_t>(kPeriod_s * 1e9);
    for (MapTag& entry : map.tags) {
      entry.tag.X_WT.p.x() += 1e-6;
      ++entry.sightings;
    }
    const auto began = std::chrono::steady_clock::now();
    auto stored = store->commit(map, kAutomaticComment);
    if (!stored || (thin && !store->thin())) return 1;
    map = std::move(*stored);
    worst_ms = std::max(worst_ms, since_ms(began));
  }
  const double ms = since_ms(start) / commits;
  const auto versions = store->log()->size();
  const auto bytes = disk.content("map").size();
  std::printf(
      "%d tags, %.1f h, %d commits: %zu versions, %.1f MB (log beside it %.1f MB), "
      "%.0f kB per version, %.1f ms per commit, at most %.0f\n",
      tags, hours, commits, versions, 1e-6 * static_cast<double>(bytes),
      1e-6 * static_cast<double>(disk.content("map-wal").size()),
      1e-3 * static_cast<double>(bytes) / static_cast<double>(versions), ms, worst_ms);
}
