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

constexpr const char* kSubject = "map";
constexpr const char* kNotStored = "not_stored";
constexpr const char* kRequestComment = "stored by an operator";

Event not_stored(const std::string& what, const std::string& why) {
  return {.severity = Severity::kError,
          .subject = kSubject,
          .kind = kNotStored,
          .text = what + " is not stored: " + why,
          .remedy =
              "mend the disk or its place; the server tries again by itself, and what is "
              "stored stays as it is"};
}

bool is_known(const ClockEstimate& clock) {
  return clock.shift_sigma_s > 0 && clock.shift_sigma_s < kKnownShift_s;
}

}  // namespace

MapKeeper::MapKeeper(MapStore store, MapBuilder& map, double commit_period_s, const Clock& clock,
                     EventBoard& events, Learned learned)
    : store_(std::move(store)),
      map_(map),
      period_(from_seconds(commit_period_s)),
      clock_(clock),
      events_(events),
      learned_(std::move(learned)) {}

void MapKeeper::run(std::stop_token stop) {
  try {
    Instant next = clock_.now() + period_;
    while (clock_.wait_until(std::min(next, clock_.now() + kLook), stop)) {
      const bool due = clock_.now() >= next;
      if (due) next += period_;
      if (requested_.exchange(false))
        commit_by_request();
      else if (due)
        commit();
    }
    requested_.exchange(false) ? commit_by_request() : commit();
    if (const auto saved = store_learned(); !saved)
      events_.tell(not_stored("what was learned about the cameras", saved.error().text()));
  } catch (const std::exception& failure) {
    events_.begin(not_stored("the map", failure.what()));
  }
}

void MapKeeper::commit() {
  // Also while frozen: what joined before the freeze is part of the map that is served.
  if (map_.changed()) store(kAutomaticComment);
}

/// What a person asked for is kept, also when it is what was stored last anyway.
void MapKeeper::commit_by_request() {
  if (map_.changed() || map_.snapshot()->comment == kAutomaticComment) store(kRequestComment);
}

void MapKeeper::store(const std::string& comment) {
  if (const auto done = store_all(comment); !done)
    return events_.begin(not_stored("the map", done.error().text()));
  events_.end(kSubject, kNotStored, "is stored again");
  thin();
}

/// Fails rarely, and costs room only.
void MapKeeper::thin() {
  const auto thinned = store_.thin();
  events_.set(!thinned,
              {.severity = Severity::kWarning,
               .subject = kSubject,
               .kind = "not_thinned",
               .text = "old versions are not taken away, the store grows" +
                       (thinned ? "" : ": " + thinned.error().text()),
               .remedy = "stop the server and run `fiducap map check`"},
              "old versions are taken away again");
}

Expected<void> MapKeeper::store_all(const std::string& comment) {
  TagMap map = *map_.snapshot();
  map.created_utc_ns = utc_now_ns();
  const auto stored = store_.commit(map, comment);
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
