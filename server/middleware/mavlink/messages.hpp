#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "middleware/mavlink/frame.hpp"

/// The messages with which two ends find each other and compare their clocks.
namespace fiducap::mavlink {

struct Timesync {
  std::int64_t tc1_ns{};  ///< 0: a question. Otherwise the answering side's clock.
  std::int64_t ts1_ns{};  ///< The asking side's clock when it asked.
};

struct Heartbeat {
  std::uint8_t type{};
  std::uint8_t autopilot{};
  std::uint8_t system_status{};
};

/// Each appends one whole frame.
void encode_heartbeat(const Sender& from, const Heartbeat& heartbeat, std::vector<std::byte>& out);
void encode_timesync(const Sender& from, const Timesync& timesync, std::vector<std::byte>& out);

/// @pre the frame is of that message. Bytes that were not sent are zero.
[[nodiscard]] Timesync decode_timesync(const Frame& frame);
[[nodiscard]] Heartbeat decode_heartbeat(const Frame& frame);

}  // namespace fiducap::mavlink
