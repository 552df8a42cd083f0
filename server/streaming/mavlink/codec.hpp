#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "middleware/mavlink/messages.hpp"
#include "streaming/conventions/autopilot_axes.hpp"

/// The messages that carry a pose → bytes, pure.
namespace fiducap::mavlink {

/// What both pose messages are made of.
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

}  // namespace fiducap::mavlink
