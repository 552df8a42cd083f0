#pragma once

#include <atomic>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/body_filter.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/store/map_store.hpp"

namespace fiducap {

/// What a body has learned about its cameras.
struct LearnedBody {
  std::string name;
  std::vector<ExtrinsicsEstimate> cameras;
};

/// Writes the map to its store: every `commit_period_s` when it has changed, on request and at the
/// end; takes away what has grown old. A store that cannot be written is a standing event
/// (`not_stored`), and tried again each period; what is stored stays as it was. What is thrown
/// costs a round.
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
  /// One round, if the map has changed or a person has asked for it.
  void commit();

 private:
  void guarded(void (MapKeeper::*work)());
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
  std::atomic<bool> requested_{false};
  std::atomic<bool> has_ended_{false};
  bool is_asked_for_{false};   ///< By a person, and not on the disk yet.
  bool learned_waits_{false};  ///< For the disk.
};

}  // namespace fiducap
