#include "capture/imu/mavlink_messages.hpp"

#include <algorithm>
#include <cmath>

#include "base/byte_reader.hpp"

namespace fiducap::mavlink {

namespace {

constexpr double kMilliG_m_s2 = 9.80665e-3;
constexpr double kMilli = 1e-3;
constexpr std::uint16_t kAccelAndGyro = 0x3f;  // of HIGHRES_IMU's fields_updated

Eigen::Vector3d read_floats(LittleEndianReader& from) {
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) v[i] = from.f32();
  return v;
}

Eigen::Vector3d read_shorts(LittleEndianReader& from) {
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) v[i] = from.i16();
  return v;
}

InertialReading decode_highres(const Frame& frame) {
  constexpr std::size_t kBetween = 28;  // magnetometer, pressures, temperature
  const auto payload = whole_payload<62>(frame);
  LittleEndianReader from(payload);
  InertialReading reading;
  reading.count = from.u64();
  reading.f = read_floats(from);
  reading.w = read_floats(from);
  from.bytes(kBetween);
  reading.is_new = (from.u16() & kAccelAndGyro) == kAccelAndGyro;
  return reading;
}

void read_scaled(LittleEndianReader& from, InertialReading& reading) {
  reading.f = kMilliG_m_s2 * read_shorts(from);
  reading.w = kMilli * read_shorts(from);
}

InertialReading decode_raw(const Frame& frame) {
  const auto payload = whole_payload<26>(frame);
  LittleEndianReader from(payload);
  InertialReading reading;
  reading.count = from.u64();
  read_scaled(from, reading);
  return reading;
}

InertialReading decode_scaled(const Frame& frame) {
  const auto payload = whole_payload<22>(frame);
  LittleEndianReader from(payload);
  InertialReading reading;
  reading.count = from.u32();
  reading.counts_ms = true;
  read_scaled(from, reading);
  return reading;
}

}  // namespace

std::optional<InertialReading> decode_inertial(const Frame& frame) {
  switch (static_cast<MessageId>(frame.message)) {
    case MessageId::kHighresImu:
      return decode_highres(frame);
    case MessageId::kRawImu:
      return decode_raw(frame);
    case MessageId::kScaledImu:
    case MessageId::kScaledImu2:
    case MessageId::kScaledImu3:
      return decode_scaled(frame);
    default:
      return std::nullopt;
  }
}

void encode_message_interval(const Sender& from, const Target& to, MessageId message,
                             double rate_hz, std::vector<std::byte>& out) {
  append_frame(from, MessageId::kCommandLong, out, [&](LittleEndianWriter& fields) {
    fields.f32(static_cast<float>(message)).f32(static_cast<float>(1e6 / rate_hz));
    for (int unused = 3; unused <= 7; ++unused) fields.f32(0);
    fields.u16(kSetMessageInterval).u8(to.system).u8(to.component).u8(0);
  });
}

void encode_sensor_stream_request(const Sender& from, const Target& to, double rate_hz,
                                  std::vector<std::byte>& out) {
  const auto rate = static_cast<std::uint16_t>(std::clamp(std::round(rate_hz), 1.0, 65535.0));
  append_frame(from, MessageId::kRequestDataStream, out, [&](LittleEndianWriter& fields) {
    fields.u16(rate).u8(to.system).u8(to.component).u8(kRawSensors).u8(1);
  });
}

CommandAck decode_command_ack(const Frame& frame) {
  const auto payload = whole_payload<3>(frame);
  LittleEndianReader from(payload);
  CommandAck ack;
  ack.command = from.u16();
  ack.result = from.u8();
  return ack;
}

}  // namespace fiducap::mavlink
