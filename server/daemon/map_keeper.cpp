#include "daemon/map_keeper.hpp"

#include <algorithm>
#include <exception>
#include <utility>

#include "base/log.hpp"
#include "daemon/system_clock.hpp"

namespace fiducap {

namespace {

// How long a requested commit may wait.
constexpr Duration kLook = std::chrono::milliseconds(200);
// A clock known better than this is worth remembering.
constexpr double kKnownShift_s = 1e-3;

bool is_known(const ClockEstimate& clock) {
  return clock.shift_sigma_s > 0 && clock.shift_sigma_s < kKnownShift_s;
}

}  // namespace

MapKeeper::MapKeeper(MapStore store, MapBuilder& map, double commit_period_s, const Clock& clock,
                     Learned learned)
    : store_(std::move(store)),
      map_(map),
      period_(from_seconds(commit_period_s)),
      clock_(clock),
      learned_(std::move(learned)) {}

void MapKeeper::run(std::stop_token stop) {
  try {
    Instant next = clock_.now() + period_;
    while (clock_.wait_until(std::min(next, clock_.now() + kLook), stop)) {
      const bool due = clock_.now() >= next;
      if (due) next += period_;
      if (requested_.exchange(false) || due) commit();
    }
    commit();
    if (const auto saved = store_learned(); !saved)
      log::error("mapping",
                 "what was learned about the cameras was not stored: " + saved.error().text());
  } catch (const std::exception& failure) {
    log::error("mapping", std::string("the map is no longer stored: ") + failure.what());
  }
}

void MapKeeper::commit() {
  // Also while frozen: what joined before the freeze is part of the map that is served.
  if (!map_.changed()) return;
  const auto done = store_all();
  if (done) {
    if (failing_) log::info("mapping", "the map is stored again");
    failing_ = false;
    return;
  }
  if (!failing_) {
    log::error("mapping", "the map was not stored (it is tried again; what is stored stays): " +
                              done.error().text());
  }
  failing_ = true;
}

Expected<void> MapKeeper::store_all() {
  TagMap map = *map_.snapshot();
  map.created_utc_ns = utc_now_ns();
  const auto stored = store_.commit(map, "mapped by fiducapd");
  if (!stored) return tl::unexpected(stored.error());
  map_.mark_stored(*stored);
  log::info("mapping", "map version " + std::to_string(stored->version) +
                           " stored: " + std::to_string(stored->tags.size()) + " tags");
  return store_learned();
}

Expected<void> MapKeeper::store_learned() {
  for (const auto& body : learned_()) {
    for (std::size_t k = 0; k < body.cameras.size(); ++k) {
      const ExtrinsicsEstimate& camera = body.cameras[k];
      StoredExtrinsics stored{body.name, static_cast<int>(k), camera.X_BV};
      if (is_known(camera.clock)) stored.clock = {camera.clock.shift_s, camera.clock.readout_s};
      if (const auto saved = store_.save_extrinsics(stored); !saved) return saved;
    }
  }
  return {};
}

}  // namespace fiducap
