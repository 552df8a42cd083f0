#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "middleware/mavlink/clock_sync.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/send_schedule.hpp"
#include "streaming/mavlink/mavlink_config.hpp"

namespace fiducap::mavlink {

/// The conversation with one autopilot, without the socket: poses at its rate while they may be
/// used and nothing in their place while not, a heartbeat a second, clock questions asked and
/// answered.
///
/// Times on the wire are the server's; the answers to the autopilot's TIMESYNC let it put them on
/// its own clock, which is what PX4 and ArduPilot expect.
class VehicleLink final {
 public:
  explicit VehicleLink(const VehicleConfig& config);

  /// One datagram from the autopilot's address. Answers are appended, at most as many bytes as
  /// came.
  void receive(std::span<const std::byte> datagram, Instant now, std::vector<std::byte>& answers);
  /// Everything due with this frame, as one datagram; nothing appended when nothing is.
  /// @param body  nullptr: the body is not in the scene   @param jumps  see PoseJumps
  void publish(const SceneFrame& frame, const BodyPose* body, std::uint32_t jumps, Instant now,
               std::vector<std::byte>& out);

  /// For the page, e.g. `drone, frd 40 Hz, system 1`. Allocates.
  [[nodiscard]] std::string status(Instant now) const;
  [[nodiscard]] std::uint64_t poses() const { return poses_; }
  [[nodiscard]] const VehicleConfig& config() const { return config_; }
  [[nodiscard]] std::optional<ClockSync::Offset> clock_offset(Instant now) const {
    return sync_.offset(now);
  }

 private:
  [[nodiscard]] Sender next_sender();
  void publish_pose(const SceneFrame& frame, const BodyPose& body, std::uint32_t jumps,
                    std::vector<std::byte>& out);

  VehicleConfig config_;
  SendSchedule schedule_;
  SendSchedule heartbeats_{1.0};
  ClockSync sync_;
  std::uint8_t sequence_{0};
  std::uint64_t poses_{0};
  std::optional<Instant> heard_at_;  ///< Newest heartbeat of an autopilot.
  std::uint8_t heard_system_{0};
};

}  // namespace fiducap::mavlink
