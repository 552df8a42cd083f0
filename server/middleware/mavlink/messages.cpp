#include "middleware/mavlink/messages.hpp"

#include "base/byte_reader.hpp"

namespace fiducap::mavlink {

void encode_heartbeat(const Sender& from, const Heartbeat& heartbeat, std::vector<std::byte>& out) {
  append_frame(from, MessageId::kHeartbeat, out, [&](LittleEndianWriter& to) {
    to.u32(0)
        .u8(heartbeat.type)
        .u8(heartbeat.autopilot)
        .u8(0)
        .u8(heartbeat.system_status)
        .u8(kProtocolVersion);
  });
}

void encode_timesync(const Sender& from, const Timesync& timesync, std::vector<std::byte>& out) {
  append_frame(from, MessageId::kTimesync, out,
               [&](LittleEndianWriter& to) { to.i64(timesync.tc1_ns).i64(timesync.ts1_ns); });
}

Timesync decode_timesync(const Frame& frame) {
  const auto payload = whole_payload<16>(frame);
  LittleEndianReader from(payload);
  Timesync timesync;
  timesync.tc1_ns = from.i64();
  timesync.ts1_ns = from.i64();
  return timesync;
}

Heartbeat decode_heartbeat(const Frame& frame) {
  const auto payload = whole_payload<9>(frame);
  LittleEndianReader from(payload);
  from.u32();  // mode, of the autopilot's own
  Heartbeat heartbeat;
  heartbeat.type = from.u8();
  heartbeat.autopilot = from.u8();
  from.u8();  // mode, of all autopilots
  heartbeat.system_status = from.u8();
  return heartbeat;
}

}  // namespace fiducap::mavlink
