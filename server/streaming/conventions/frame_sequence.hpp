#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// @return something with this period is due at `at`, up to `early` too soon; then `next` is moved
/// by a period. After a gap it restarts from `at`.
[[nodiscard]] inline bool is_period_due(std::optional<Instant>& next, Instant at, Duration period,
                                        Duration early) {
  if (next && at + early < *next) return false;
  next = (next && at < *next + period ? *next : at) + period;
  return true;
}

/// Selects frames of a faster stream for a lower rate: evenly, with exactly that mean rate.
class SendSchedule final {
 public:
  explicit SendSchedule(double rate_hz) : period_(from_seconds(1.0 / rate_hz)) {}

  /// @return this frame is due; up to half a frame early counts.
  bool is_due(Instant at, double frame_rate_hz) {
    const Duration early = frame_rate_hz > 0 ? from_seconds(0.5 / frame_rate_hz) : Duration{0};
    return is_period_due(next_, at, period_, early);
  }

 private:
  Duration period_;
  std::optional<Instant> next_;
};

/// Counts per body the jumps of its pose that motion does not explain: valid again, a step of the
/// map, or an alignment of the map of any size; not the slow corrections of CorrectionRamp. Clients
/// that fuse the stream restart at a jump. `observe` allocates nothing after warm-up.
class PoseJumps final {
 public:
  void observe(const SceneFrame& frame);
  /// @param place  in frame.bodies
  [[nodiscard]] std::uint32_t count(std::size_t place) const {
    return place < bodies_.size() ? bodies_[place].count : 0;
  }

 private:
  struct Seen {
    int body_id{};
    bool ever{false};
    bool valid{false};
    Instant at{};
    std::uint64_t axes{};
    Pose X_WP{};
    std::uint32_t count{0};
  };
  [[nodiscard]] static bool is_jump(const Seen& before, const BodyPose& now, Instant at);

  std::vector<Seen> bodies_;
};

}  // namespace fiducap
