// Is killed by map_store_kill_test. Works on a store until then, and prints a line for each stored
// version, with its hash if known:
//   map_store_writer commits STORE      versions with ties, every third one a roll-back
//   map_store_writer refines STORE      a server's own loops: the map of robots that come one after
//                                       the other is refined, committed, thinned out
//   map_store_writer migrates STORE...  opens one after the other, and prints which is open
#include <unistd.h>

#include <cstdio>
#include <span>
#include <string>
#include <thread>

#include "base/log.hpp"
#include "daemon/map_keeper.hpp"
#include "daemon/system.hpp"
#include "mapping/store/map_store.hpp"
#include "simulation/graph_robot.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

bool report(std::int64_t version, const std::string& hash) {
  const std::string line = std::to_string(version) + " " + (hash.empty() ? "-" : hash) + "\n";
  return write(STDOUT_FILENO, line.data(), line.size()) >= 0;
}

int fails(const Error& error) {
  std::fprintf(stderr, "%s\n", error.text().c_str());
  return 1;
}

int commits(const std::string& path) {
  auto store = MapStore::open(path);
  if (!store) return fails(store.error());
  auto map = store->newest();
  if (!map) return fails(map.error());
  if (map->tags.empty()) *map = with_ties(make_map(first_ids(40)));
  for (;;) {
    const bool goes_back = map->version > 2 && map->version % 3 == 0;
    if (goes_back) {
      map = store->load(map->version - 2);
      if (!map) return fails(map.error());
    } else {
      for (MapTag& entry : map->tags) entry.tag.X_WT.p.x() += 0.001;
    }
    map = store->commit(*map, goes_back ? "rolled back" : "while being killed");
    if (!map) return fails(map.error());
    const auto saved =
        store->save_extrinsics({"robot", static_cast<int>(map->version % 4), Pose{}});
    if (!saved) return fails(saved.error());
    if (!report(map->version, map->hash)) return 1;
  }
}

/// Short: a kill mostly interrupts one of the loops.
constexpr double kPeriod_s = 0.002;
constexpr double kSeconds = 8;  // of motion
constexpr int kReference = 1;
constexpr auto kPause = std::chrono::milliseconds(1);
constexpr int kMostPauses = 100;

int refines(const std::string& path) {
  auto store = MapStore::open(path);
  if (!store) return fails(store.error());
  auto start = store->newest();
  if (!start) return fails(start.error());
  const Robot robot({.seconds = kSeconds, .reference_tag = kReference});
  if (robot.segments.empty()) return 3;
  start->reference_tag = kReference;
  MapConfig config;
  config.refine_period_s = kPeriod_s;
  MapBuilder map(config, std::move(*start));
  const SystemClock clock;
  EventBoard events(utc_now_ns);
  const auto learned = [] {
    ExtrinsicsEstimate camera;
    camera.clock = {.shift_s = 0.02, .shift_sigma_s = 1e-4};
    return std::vector<LearnedBody>{{"robot", {camera}}};
  };
  MapKeeper keeper(std::move(*store), map, kPeriod_s, clock, events, learned);
  RefinementLoop refinement(map, kPeriod_s, clock, events, [](const RefinementTurn&) {});
  const std::jthread refining([&](const std::stop_token& stop) { refinement.run(stop); });
  const std::jthread keeping([&](const std::stop_token& stop) { keeper.run(stop); });
  std::int64_t reported = map.snapshot()->version;
  // All bodies saw the same second: the graph stays small, with new segments all the time.
  const auto second = std::make_shared<const MotionSegment>(robot.segments.front());
  for (int body_id = 1;; ++body_id) {
    map.absorb({.body_id = body_id, .at = second->end().at, .anchored = true, .segment = second},
               utc_now_ns());
    auto now = map.snapshot();
    for (int i = 0; i < kMostPauses && now->version == reported; ++i) {
      std::this_thread::sleep_for(kPause);
      now = map.snapshot();
    }
    if (now->version != reported && !report(now->version, now->hash)) return 1;
    reported = now->version;
  }
}

int migrates(std::span<char* const> paths) {
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const auto store = MapStore::open(paths[i]);
    if (!store) return fails(store.error());
    if (!report(static_cast<std::int64_t>(i) + 1, {})) return 1;
  }
  for (;;) pause();
}

}  // namespace
}  // namespace fiducap

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  fiducap::log::set_level(fiducap::log::Level::kError);
  const std::string verb = argv[1];
  if (verb == "commits") return fiducap::commits(argv[2]);
  if (verb == "refines") return fiducap::refines(argv[2]);
  return fiducap::migrates({argv + 2, argv + argc});
}
