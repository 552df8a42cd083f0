#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "middleware/mavlink/clock_sync.hpp"
#include "middleware/mavlink/frame.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/frame_sequence.hpp"
#include "streaming/mavlink/mavlink.hpp"

namespace fiducap::mavlink {

/// Content of both pose messages.
struct PoseReport {
  std::uint64_t time_us{};
  AutopilotWorld world{AutopilotWorld::kFrd};
  AutopilotOdometry odometry;
  std::uint8_t reset_counter{};
  std::int8_t quality{};
};

/// Each appends one whole frame. ODOMETRY: pose in the world axes, velocity and rate in the body's.
void encode_odometry(const Sender& from, const PoseReport& report, std::vector<std::byte>& out);
/// VISION_POSITION_ESTIMATE: pose only.
void encode_vision_position(const Sender& from, const PoseReport& report,
                            std::vector<std::byte>& out);

/// The messages to and from one autopilot, without a socket: poses at its rate while they are
/// valid, a heartbeat per second, TIMESYNC in both directions.
///
/// Times on the wire are the server's; the autopilot converts them by its TIMESYNC.
class VehicleLink final {
 public:
  explicit VehicleLink(const VehicleConfig& config);

  /// One datagram from the autopilot's address. Appends replies, at most as many bytes as came.
  void receive(std::span<const std::byte> datagram, Instant now, std::vector<std::byte>& answers);
  /// Appends all that is due with this frame, for one datagram.
  /// @param body  nullptr: not in the scene   @param jumps  see PoseJumps
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
