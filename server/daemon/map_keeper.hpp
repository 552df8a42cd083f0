#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "capture/lens/camera_model.hpp"
#include "daemon/version_shelf.hpp"
#include "estimation/body_filter.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/map_change.hpp"
#include "mapping/store/map_store.hpp"

namespace fiducap {

/// What a body has learned about its cameras.
struct LearnedBody {
  std::string name;
  std::vector<ExtrinsicsEstimate> cameras;
  std::vector<Duration> told_shifts{};  ///< Per camera, CameraMount::time_shift; none: 0.
};

/// Writes the map to its store, and takes stored versions out of it again: every `commit_period_s`
/// when it has changed, on request and at the end; takes away what has grown old. A store that
/// cannot be written is a standing event
/// (`not_stored`), and tried again each period; what is stored stays as it was. What is thrown
/// costs a round. What an operator asked for, and how it went, is told (`version_stored`,
/// `rolled_back`, `version_named`, `refused`).
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
  /// The next round comes now, not at the end of the period. From any thread.
  void request_commit() { requested_ = true; }
  /// An operator's wish; done within a moment and in order. From any thread.
  /// @return Error when too many wait
  Expected<void> request(StoreChange change);
  /// What is in the store, for who may not wait for it. From any thread.
  [[nodiscard]] VersionShelf& shelf() { return shelf_; }
  /// Puts on the shelf what has changed, and what was asked for. Of the keeper's thread.
  void fill_shelf() { guarded(&MapKeeper::refill_shelf); }
  /// One round: operators' wishes, then the map if it has changed or a person has asked for it.
  void commit();

 private:
  void guarded(void (MapKeeper::*work)());
  void carry_out_requests();
  void carry_out(const StoreChange& change);
  [[nodiscard]] Expected<void> roll_back(std::int64_t version);
  [[nodiscard]] Expected<void> name_version(const NameVersion& change);
  void refill_shelf();
  void tell(const char* kind, std::string text);
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
  VersionShelf shelf_;
  bool is_log_old_{true};  ///< On the shelf.
  std::mutex requests_mutex_;
  std::vector<StoreChange> requests_;  ///< Guarded by the mutex.
  std::atomic<bool> requested_{false};
  std::atomic<bool> has_ended_{false};
  std::optional<std::string> asked_for_{};  ///< By a person, under this name; not on the disk yet.
  bool learned_waits_{false};               ///< For the disk.
};

}  // namespace fiducap
