#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <stop_token>

#include "base/time.hpp"
#include "mapping/map_builder.hpp"
#include "scene/scene.hpp"

namespace fiducap {

/// Publishes a frame of all bodies at a fixed rate. The schedule is absolute: a late tick does not
/// move the next one, and missed ticks are skipped.
class Publisher final {
 public:
  using Receiver = std::function<void(std::shared_ptr<const SceneFrame>)>;

  /// @param receiver  called on the publisher's thread, must not wait
  Publisher(double rate_hz, Scene& scene, const MapBuilder& map, const Clock& clock,
            Receiver receiver);

  /// Ticks until stopped.
  void run(std::stop_token stop);
  /// So far. From any thread.
  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  [[nodiscard]] std::uint64_t missed() const { return missed_; }

 private:
  void publish();
  void read_utc(Instant now);

  double rate_hz_;
  Duration period_;
  Scene& scene_;
  const MapBuilder& map_;
  const Clock& clock_;
  Receiver receiver_;
  Duration utc_offset_{};
  Instant utc_read_at_{};
  std::atomic<std::uint64_t> frames_{0};
  std::atomic<std::uint64_t> missed_{0};
  std::uint64_t failures_{0};
};

}  // namespace fiducap
