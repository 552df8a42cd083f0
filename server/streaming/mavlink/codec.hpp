#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/expected.hpp"
#include "streaming/conventions/autopilot_axes.hpp"
#include "streaming/mavlink/protocol.hpp"

/// MAVLink ↔ structs, pure bytes. Little-endian; a payload's trailing zeros are not sent.
namespace fiducap::mavlink {

/// The sender.
struct Sender {
  std::uint8_t system{};
  std::uint8_t component{};
  std::uint8_t sequence{};
};

struct Timesync {
  std::int64_t tc1_ns{};  ///< 0: a question. Otherwise the answering side's clock.
  std::int64_t ts1_ns{};  ///< The asking side's clock when it asked.
};

struct Heartbeat {
  std::uint8_t type{};
  std::uint8_t autopilot{};
  std::uint8_t system_status{};
};

/// What both pose messages are made of.
struct PoseReport {
  std::uint64_t time_us{};
  AutopilotWorld world{AutopilotWorld::kFrd};
  AutopilotOdometry odometry;
  std::uint8_t reset_counter{};
  std::int8_t quality{};
};

/// Each appends one whole frame.
void encode_heartbeat(const Sender& from, const Heartbeat& heartbeat, std::vector<std::byte>& out);
void encode_timesync(const Sender& from, const Timesync& timesync, std::vector<std::byte>& out);
/// ODOMETRY: pose in the world axes, velocity and rate in the body's.
void encode_odometry(const Sender& from, const PoseReport& report, std::vector<std::byte>& out);
/// VISION_POSITION_ESTIMATE: pose only.
void encode_vision_position(const Sender& from, const PoseReport& report,
                            std::vector<std::byte>& out);

struct Frame {
  std::uint32_t message{};
  std::uint8_t system{};
  std::uint8_t component{};
  std::span<const std::byte> payload;
};

/// Takes the next frame of a message we know from `in`, with a right checksum. Other messages and
/// noise are passed over; what is left of a datagram afterwards is less than a frame.
/// @return nullopt when there is none
[[nodiscard]] std::optional<Frame> next_frame(std::span<const std::byte>& in);

/// @pre the frame is of that message. Bytes that were not sent are zero.
[[nodiscard]] Timesync decode_timesync(const Frame& frame);
[[nodiscard]] Heartbeat decode_heartbeat(const Frame& frame);

}  // namespace fiducap::mavlink
