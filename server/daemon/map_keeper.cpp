#include "daemon/map_keeper.hpp"

#include <algorithm>
#include <cmath>
#include <exception>

#include "base/log.hpp"
#include "daemon/system.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostCached = 8;
constexpr std::size_t kMostWanted = 8;  // further ones are requested again

bool contains(const VersionCache::Log& log, std::int64_t version) {
  return std::ranges::any_of(log,
                             [&](const MapVersionInfo& one) { return one.version == version; });
}

// Longest delay of a requested commit.
constexpr Duration kLook = std::chrono::milliseconds(200);
// A more certain clock offset is stored.
constexpr double kKnownShift_s = 1e-3;

constexpr std::size_t kMostRequests = 16;

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
              "repair the disk or its place; the server retries automatically, and stored versions "
              "stay as they are"};
}

/// Estimated numbers that differ significantly from the configuration.
StoredLens stored_lens(const LensEstimate& lens) {
  constexpr double kSure_sigma = 3.0;
  const auto if_sure = [](double value, double sigma) {
    return sigma > 0 && std::abs(value) > kSure_sigma * sigma ? std::optional(value) : std::nullopt;
  };
  return {if_sure(lens.offset.focal, lens.focal_sigma),
          if_sure(lens.offset.centre_px.x(), lens.centre_sigma_px.x()),
          if_sure(lens.offset.centre_px.y(), lens.centre_sigma_px.y()),
          if_sure(lens.offset.k1, lens.k1_sigma)};
}

}  // namespace

std::shared_ptr<const VersionCache::Log> VersionCache::log() const {
  const std::lock_guard lock(mutex_);
  return log_;
}

bool VersionCache::has(std::int64_t version) const { return contains(*log(), version); }

VersionCache::Content VersionCache::version(std::int64_t version) {
  const std::lock_guard lock(mutex_);
  if (!contains(*log_, version))
    return fail(ErrorCode::kNotFound,
                "there is no version " + std::to_string(version) + " in the store");
  const auto found =
      std::ranges::find_if(cached_, [&](const auto& one) { return one.first == version; });
  if (found != cached_.end()) return found->second;
  const bool is_asked_for = std::find(wanted_.begin(), wanted_.end(), version) != wanted_.end();
  if (!is_asked_for && wanted_.size() < kMostWanted) wanted_.push_back(version);
  return nullptr;
}

void VersionCache::put_log(Log log) {
  auto next = std::make_shared<const Log>(std::move(log));
  const std::lock_guard lock(mutex_);
  log_ = std::move(next);
}

std::vector<std::int64_t> VersionCache::take_wanted() {
  const std::lock_guard lock(mutex_);
  return std::exchange(wanted_, {});
}

void VersionCache::put(std::int64_t version, Content content) {
  const std::lock_guard lock(mutex_);
  cached_.emplace_back(version, std::move(content));
  if (cached_.size() > kMostCached) cached_.pop_front();
}

MapKeeper::MapKeeper(MapStore store, MapBuilder& map, double commit_period_s, const Clock& clock,
                     EventBoard& events, Learned learned)
    : store_(std::move(store)),
      map_(map),
      period_(from_seconds(commit_period_s)),
      clock_(clock),
      events_(events),
      learned_(std::move(learned)) {
  update_cache();
}

void MapKeeper::run(std::stop_token stop) {
  Instant next = clock_.now() + period_;
  while (clock_.wait_until(std::min(next, clock_.now() + kLook), stop)) {
    const bool due = clock_.now() >= next;
    if (due) next += period_;
    if (due || requested_) {
      commit();
    } else {
      guarded(&MapKeeper::carry_out_requests);
    }
    update_cache();
  }
  learned_waits_ = true;
  commit();
  has_ended_ = true;
}

void MapKeeper::commit() {
  guarded(&MapKeeper::carry_out_requests);
  guarded(&MapKeeper::store_map);
  guarded(&MapKeeper::store_learned);
}

/// Reports exceptions, e.g. of missing memory.
void MapKeeper::guarded(void (MapKeeper::*work)()) {
  try {
    (this->*work)();
  } catch (const std::exception& failure) {
    log::guarded(
        "mapping", [] { return "reporting that the map is not stored"; },
        [&] { events_.begin(not_stored(kNotStored, "the map", failure.what())); });
  }
}

void MapKeeper::store_map() {
  // Also while frozen: tags may have joined before. A requested version is stored under its name,
  // also without a change.
  const bool is_wanted =
      map_.changed() || (asked_for_ && (*asked_for_ != kRequestComment ||
                                        map_.snapshot()->comment == kAutomaticComment));
  if (is_wanted) {
    const auto stored = store_version(asked_for_.value_or(kAutomaticComment));
    if (!stored) return events_.begin(not_stored(kNotStored, "the map", stored.error().text()));
    learned_waits_ = true;
  }
  const bool is_asked_for = std::exchange(asked_for_, std::nullopt).has_value();
  events_.end(kSubject, kNotStored, "is stored again");
  if (is_asked_for)
    report("version_stored",
           (is_wanted ? "is stored as version " : "is stored already, as version ") +
               std::to_string(map_.snapshot()->version));
  if (!is_wanted) return;
  is_log_old_ = true;
  thin();
}

/// A failure only costs disk space.
void MapKeeper::thin() {
  const auto thinned = store_.thin();
  events_.set(!thinned,
              {.severity = Severity::kWarning,
               .subject = kSubject,
               .kind = "not_thinned",
               .text = "old versions are not removed, the store grows" +
                       (thinned ? "" : ": " + thinned.error().text()),
               .remedy = "stop the server and run `fiducap map check`"},
              "old versions are removed again");
}

Expected<void> MapKeeper::request(StoreChange change) {
  const std::lock_guard lock(requests_mutex_);
  if (requests_.size() >= kMostRequests)
    return fail(ErrorCode::kUnavailable, "the disk of the map is slow, and " +
                                             std::to_string(kMostRequests) +
                                             " commands wait for it: try again later");
  requests_.push_back(std::move(change));
  return {};
}

void MapKeeper::carry_out_requests() {
  if (requested_) {
    if (!asked_for_) asked_for_ = kRequestComment;
    requested_ = false;
  }
  std::vector<StoreChange> requests;
  {
    const std::lock_guard lock(requests_mutex_);
    requests.swap(requests_);
  }
  for (const StoreChange& change : requests) carry_out(change);
}

void MapKeeper::carry_out(const StoreChange& change) {
  Expected<void> done;
  std::string what;
  if (const auto* commit = std::get_if<CommitVersion>(&change)) {
    asked_for_ = commit->name.empty() ? kRequestComment : commit->name;
    return store_map();
  }
  if (const auto* back = std::get_if<RollBack>(&change)) {
    what = "not rolled back to version " + std::to_string(back->version);
    done = roll_back(back->version);
  } else if (const auto* name = std::get_if<NameVersion>(&change)) {
    what = "version " + std::to_string(name->version) + " is not named";
    done = name_version(*name);
  }
  is_log_old_ = true;
  if (done) return;
  events_.report({.severity = Severity::kWarning,
                  .subject = kSubject,
                  .kind = "refused",
                  .text = what + ": " + done.error().text(),
                  .remedy = "The map is unchanged; try again when the cause is fixed"});
}

/// First stores the present map, so that nothing is lost, then the old version as the newest one,
/// and serves it. A kill in between leaves one or the other.
Expected<void> MapKeeper::roll_back(std::int64_t version) {
  auto wanted = store_.load(version);
  if (!wanted) return tl::unexpected(wanted.error());
  if (auto may = map_.check_replacement(*wanted); !may) return may;
  if (map_.changed()) {
    if (auto stored = store_version(kAutomaticComment); !stored) return stored;
  }
  wanted->created_utc_ns = utc_now_ns();
  wanted->X_RW = map_.snapshot()->X_RW;  // the origin that clients know stays
  const auto stored = store_.commit(*wanted, "rolled back to version " + std::to_string(version));
  if (!stored) return tl::unexpected(stored.error());
  if (auto begun = map_.replace_map(*stored, utc_now_ns()); !begun) {
    // Frozen meanwhile: the newest version has to be the served one.
    if (auto again = store_version(kAutomaticComment); !again) return again;
    return begun;
  }
  map_.mark_stored(*stored);
  report("rolled_back", "was rolled back to version " + std::to_string(version) + ", stored as " +
                            std::to_string(stored->version) + " with " +
                            std::to_string(stored->tags.size()) + " tags");
  return {};
}

Expected<void> MapKeeper::name_version(const NameVersion& change) {
  auto named = store_.name_version(change.version, change.name);
  if (named)
    report("version_named",
           "version " + std::to_string(change.version) + " is called \"" + change.name + "\"");
  return named;
}

void MapKeeper::report(const char* kind, std::string text) {
  events_.report({.subject = kSubject, .kind = kind, .text = std::move(text)});
}

void MapKeeper::refill_cache() {
  if (is_log_old_) {
    auto log = store_.log();
    is_log_old_ = !log;
    if (log) versions_.put_log(std::move(*log));
  }
  for (const std::int64_t version : versions_.take_wanted()) {
    auto map = store_.load(version);
    versions_.put(version,
                  map ? VersionCache::Content(std::make_shared<const TagMap>(std::move(*map)))
                      : tl::unexpected(map.error()));
  }
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
      stored.lens = stored_lens(camera.lens);
      // The total offset: the next configuration may contain a part of it.
      const Duration configured =
          k < body.configured_shifts.size() ? body.configured_shifts[k] : Duration{};
      if (const double sigma_s = camera.clock.shift_sigma_s; sigma_s > 0 && sigma_s < kKnownShift_s)
        stored.clock = {to_seconds(configured) + camera.clock.shift_s, camera.clock.readout_s};
      if (const auto saved = store_.save_extrinsics(stored); !saved) return saved;
    }
  }
  return {};
}

}  // namespace fiducap
