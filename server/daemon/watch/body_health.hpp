#pragma once

#include <optional>
#include <string>

#include "base/event_board.hpp"
#include "daemon/bodies/body_pulse.hpp"
#include "pipeline/body_pose.hpp"

namespace fiducap {

/// Says in words what is wrong with one body, once, and when it is over: no images, images that
/// come late or are too many for this computer, a pose that is carried or lost. Looked at twice a
/// second or so. Not thread-safe.
class BodyHealth final {
 public:
  BodyHealth(std::string name, std::size_t cameras, const BodyPulse& pulse, EventBoard& events)
      : name_(std::move(name)), cameras_(cameras), pulse_(pulse), events_(events) {}

  /// @param pose  of the newest frame; nullptr: the body is not streamed
  void look(const BodyPose* pose, Instant now);

 private:
  void judge_source(Instant now);
  void judge_silence(std::int64_t came_ns, const std::string& kind, const std::string& camera,
                     Instant now);
  void judge_lateness(Instant now);
  void judge_pose(const BodyPose& pose, Instant now);
  [[nodiscard]] Event lost(Instant now) const;
  [[nodiscard]] double seconds_since(std::optional<Instant>& begin, bool holds, Instant now) const;
  [[nodiscard]] Event event(Severity severity, std::string kind, std::string text,
                            std::string remedy) const;

  std::string name_;
  std::size_t cameras_;
  const BodyPulse& pulse_;
  EventBoard& events_;
  std::optional<Instant> watched_since_;
  std::optional<Instant> late_since_;
  std::optional<Instant> untracked_since_;
  std::uint64_t images_{0};  ///< As counted at `counted_at_`.
  std::uint64_t skipped_{0};
  std::optional<Instant> counted_at_;
  double skipped_share_{0};
  bool was_tracked_{false};
};

}  // namespace fiducap
