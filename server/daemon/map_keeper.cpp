#include "daemon/map_keeper.hpp"

#include <algorithm>
#include <exception>
#include <utility>

#include "base/log.hpp"
#include "daemon/system_clock.hpp"
#include "streaming/net/guard.hpp"

namespace fiducap {

namespace {

// How long a requested commit may wait.
constexpr Duration kLook = std::chrono::milliseconds(200);
// A clock known better than this is worth remembering.
constexpr double kKnownShift_s = 1e-3;

constexpr const char* kSubject = "map";
constexpr const char* kNotStored = "not_stored";
constexpr const char* kCamerasNotStored = "cameras_not_stored";
constexpr const char* kRequestComment = "stored by an operator";

Event not_stored(const char* kind, const std::string& what, const std::string& why) {
  return {.severity = Severity::kError,
          .subject = kSubject,
          .kind = kind,
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
  Instant next = clock_.now() + period_;
  while (clock_.wait_until(std::min(next, clock_.now() + kLook), stop)) {
    const bool due = clock_.now() >= next;
    if (due) next += period_;
    if (due || requested_) commit();
  }
  learned_waits_ = true;
  commit();
  has_ended_ = true;
}

void MapKeeper::commit() {
  if (requested_.exchange(false)) is_asked_for_ = true;
  guarded(&MapKeeper::store_map);
  guarded(&MapKeeper::store_learned);
}

/// No memory, for example.
void MapKeeper::guarded(void (MapKeeper::*work)()) {
  try {
    (this->*work)();
  } catch (const std::exception& failure) {
    net::guarded(
        "mapping", [] { return "saying that the map is not stored"; },
        [&] { events_.begin(not_stored(kNotStored, "the map", failure.what())); });
  }
}

void MapKeeper::store_map() {
  // Also while frozen: what joined before the freeze is part of the map that is served. What a
  // person asked for is kept, also when it is what was stored last anyway.
  const bool is_wanted =
      map_.changed() || (is_asked_for_ && map_.snapshot()->comment == kAutomaticComment);
  if (is_wanted) {
    const auto stored = store_version(is_asked_for_ ? kRequestComment : kAutomaticComment);
    if (!stored) return events_.begin(not_stored(kNotStored, "the map", stored.error().text()));
    learned_waits_ = true;
  }
  is_asked_for_ = false;
  events_.end(kSubject, kNotStored, "is stored again");
  if (is_wanted) thin();
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

Expected<void> MapKeeper::store_version(const std::string& comment) {
  TagMap map = *map_.snapshot();
  map.created_utc_ns = utc_now_ns();
  const auto stored = store_.commit(map, comment);
  if (!stored) return tl::unexpected(stored.error());
  map_.mark_stored(*stored);
  log::info("mapping", "map version " + std::to_string(stored->version) +
                           " stored: " + std::to_string(stored->tags.size()) + " tags");
  return {};
}

void MapKeeper::store_learned() {
  if (!learned_waits_) return;
  const auto stored = store_cameras();
  learned_waits_ = !stored;
  if (!stored)
    return events_.begin(
        not_stored(kCamerasNotStored, "what was learned about the cameras", stored.error().text()));
  events_.end(kSubject, kCamerasNotStored, "what was learned about the cameras is stored again");
}

Expected<void> MapKeeper::store_cameras() {
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
