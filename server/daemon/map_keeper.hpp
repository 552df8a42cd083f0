#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/body_filter.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/map_edit.hpp"
#include "mapping/map_refiner.hpp"
#include "mapping/store/map_rows.hpp"
#include "mapping/store/map_store.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Versions of a store, readable without waiting for its disk: the list and the versions that were
/// requested last. Filled by the owner of the store. Thread-safe.
class VersionCache final {
 public:
  using Log = std::vector<MapVersionInfo>;
  using Content = Expected<std::shared_ptr<const TagMap>>;

  /// Newest first; never nullptr.
  [[nodiscard]] std::shared_ptr<const Log> log() const;
  [[nodiscard]] bool has(std::int64_t version) const;
  /// @return nullptr: it is being read, ask again in a moment; Error `kNotFound` when there is none
  [[nodiscard]] Content version(std::int64_t version);

  void put_log(Log log);
  /// Requested and not cached, since the last call.
  [[nodiscard]] std::vector<std::int64_t> take_wanted();
  void put(std::int64_t version, Content content);

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Log> log_{std::make_shared<const Log>()};
  std::vector<std::int64_t> wanted_;
  std::deque<std::pair<std::int64_t, Content>> cached_;
};

/// The estimated cameras of a body.
struct LearnedBody {
  std::string name;
  std::vector<ExtrinsicsEstimate> cameras;
  std::vector<Duration> configured_shifts{};  ///< Per camera, CameraMount::time_shift; none: 0.
};

/// Stores the map: every `commit_period_s` when it has changed, on request and at the end; loads
/// stored versions and removes old ones. A store that cannot be written is a lasting event
/// (`not_stored`) and is tried again each period; stored versions stay as they are. An exception
/// costs a round. Results of an operator's requests are events (`version_stored`, `rolled_back`,
/// `version_named`, `refused`).
class MapKeeper final {
 public:
  using Learned = std::function<std::vector<LearnedBody>()>;

  /// @param learned  called on the keeper's thread before each commit
  MapKeeper(MapStore store, MapBuilder& map, double commit_period_s, const Clock& clock,
            EventBoard& events, Learned learned);

  /// Commits until stopped, and once more then.
  void run(std::stop_token stop);
  /// Until `run` has returned. From any thread.
  [[nodiscard]] bool is_running() const { return !has_ended_; }
  /// Starts the next round now. From any thread.
  void request_commit() { requested_ = true; }
  /// An operator's request; done within a moment and in order. From any thread.
  /// @return Error when too many wait
  Expected<void> request(StoreChange change);
  /// The content of the store. From any thread.
  [[nodiscard]] VersionCache& versions() { return versions_; }
  /// On the keeper's thread.
  void update_cache() { guarded(&MapKeeper::refill_cache); }
  /// One round: requests, then the map if it has changed or a commit was requested.
  void commit();

 private:
  void guarded(void (MapKeeper::*work)());
  void carry_out_requests();
  void carry_out(const StoreChange& change);
  [[nodiscard]] Expected<void> roll_back(std::int64_t version);
  [[nodiscard]] Expected<void> name_version(const NameVersion& change);
  void refill_cache();
  void report(const char* kind, std::string text);
  void store_map();
  [[nodiscard]] Expected<void> store_version(const std::string& comment);
  void thin();
  void store_learned();
  [[nodiscard]] Expected<void> store_cameras();

  MapStore store_;
  MapBuilder& map_;
  Duration period_;
  const Clock& clock_;
  EventBoard& events_;
  Learned learned_;
  VersionCache versions_;
  bool is_log_old_{true};  ///< In the cache.
  std::mutex requests_mutex_;
  std::vector<StoreChange> requests_;  ///< Guarded by the mutex.
  std::atomic<bool> requested_{false};
  std::atomic<bool> has_ended_{false};
  std::optional<std::string> asked_for_{};  ///< Name of a requested version, not on the disk yet.
  bool learned_waits_{false};               ///< For the disk.
};

/// Solves the map every `period_s`, in a background thread of its own; no body waits for it. A stop
/// aborts the solution. An exception costs a round.
///
/// When other work leaves no time, this is reported (`map_late`) and solutions get normal priority.
/// So do the first solutions: before there is a map, bodies search whole images, which saturates a
/// small computer (eight robots on one core: 130 %). Without the right to restore priorities, all
/// solutions have normal priority.
class RefinementLoop final {
 public:
  /// @param done  called after each, on that thread
  RefinementLoop(MapBuilder& map, double period_s, const Clock& clock, EventBoard& events,
                 std::function<void(const RefinementTurn&)> done)
      : refiner_(map),
        period_(from_seconds(period_s)),
        clock_(clock),
        events_(events),
        done_(std::move(done)) {}

  /// Until stopped.
  void run(std::stop_token stop);

 private:
  class Solver;
  [[nodiscard]] bool solve(Solver& solver, const std::stop_token& stop);
  void report_lateness(bool is_late);

  MapRefiner refiner_;
  Duration period_;
  const Clock& clock_;
  EventBoard& events_;
  std::function<void(const RefinementTurn&)> done_;
  bool has_map_{false};
  Instant background_from_{};  ///< Solutions have normal priority until then.
};

}  // namespace fiducap
