#include "capture/imu/mavlink_vehicle.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "base/bytes.hpp"
#include "base/text.hpp"

namespace fiducap::mavlink {
namespace {

constexpr double kMilliG_m_s2 = 9.80665e-3;
constexpr double kMilli = 1e-3;
constexpr std::uint16_t kAccelAndGyro = 0x3f;  // of HIGHRES_IMU's fields_updated

/// @param number  reads one
template <typename Number>
Eigen::Vector3d read_vector(LittleEndianReader& from, Number (LittleEndianReader::*number)()) {
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) v[i] = (from.*number)();
  return v;
}

InertialReading decode_highres(const Frame& frame) {
  constexpr std::size_t kBetween = 28;  // magnetometer, pressures, temperature
  const auto payload = whole_payload<62>(frame);
  LittleEndianReader from(payload);
  InertialReading reading;
  reading.count = from.u64();
  reading.f = read_vector(from, &LittleEndianReader::f32);
  reading.w = read_vector(from, &LittleEndianReader::f32);
  from.bytes(kBetween);
  reading.is_new = (from.u16() & kAccelAndGyro) == kAccelAndGyro;
  return reading;
}

/// RAW_IMU and SCALED_IMU differ in the count only.
InertialReading decode_scaled(const Frame& frame, bool counts_ms) {
  const auto payload = whole_payload<26>(frame);
  LittleEndianReader from(payload);
  InertialReading reading;
  reading.count = counts_ms ? from.u32() : from.u64();
  reading.counts_ms = counts_ms;
  reading.f = kMilliG_m_s2 * read_vector(from, &LittleEndianReader::i16);
  reading.w = kMilli * read_vector(from, &LittleEndianReader::i16);
  return reading;
}

constexpr Duration kVehicleGone = std::chrono::seconds(10);
constexpr Duration kMoved = std::chrono::seconds(3);  // until another port or address is accepted

/// Not of a ground station, a companion computer or a camera.
bool is_of_autopilot(const Frame& frame) {
  if (!frame.is(MessageId::kHeartbeat)) return decode_inertial(frame).has_value();
  return decode_heartbeat(frame).autopilot != kNoAutopilot;
}

std::string text_of_system(std::uint8_t system, const net::Peer& at) {
  const std::string text = "system " + std::to_string(system);
  return at.port == 0 ? text : text + " at " + text_of(at);
}

constexpr Duration kMeasured = std::chrono::seconds(1);
constexpr Duration kOften = std::chrono::seconds(1);
constexpr Duration kSeldom = std::chrono::seconds(10);
constexpr int kOftenTimes = 6;
constexpr double kEnough = 0.8;  // of the request: autopilots divide their loop by whole numbers

}  // namespace

MessageId message_of(MavlinkImuMessage choice) {
  constexpr std::array kInOrder{MessageId::kHighresImu, MessageId::kHighresImu,
                                MessageId::kRawImu,     MessageId::kScaledImu,
                                MessageId::kScaledImu2, MessageId::kScaledImu3};
  return kInOrder[static_cast<std::size_t>(choice)];
}

std::optional<InertialReading> decode_inertial(const Frame& frame) {
  switch (static_cast<MessageId>(frame.message)) {
    case MessageId::kHighresImu:
      return decode_highres(frame);
    case MessageId::kRawImu:
      return decode_scaled(frame, false);
    case MessageId::kScaledImu:
    case MessageId::kScaledImu2:
    case MessageId::kScaledImu3:
      return decode_scaled(frame, true);
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

bool VehicleChoice::is_candidate(const Frame& frame) const {
  return is_of_autopilot(frame) && (wanted_ == 0 || frame.system == wanted_);
}

bool VehicleChoice::accept(const Frame& frame, const net::Peer& from, Instant now,
                           bool may_replace) {
  const bool is_ours = vehicle_ && frame.system == vehicle_->system &&
                       frame.component == vehicle_->component && from == vehicle_->at;
  if (!is_ours) {
    if (!is_of_autopilot(frame)) return false;
    const bool is_same = vehicle_ && frame.system == vehicle_->system;
    const bool is_free =
        !vehicle_ || may_replace || now - vehicle_->received_at > (is_same ? kMoved : kVehicleGone);
    if (!is_candidate(frame) || !is_free) {
      note_foreign(frame, from);
      return false;
    }
    ++changes_;
    vehicle_ = Vehicle{frame.system, frame.component, 0, from, now};
  }
  vehicle_->received_at = now;
  if (frame.is(MessageId::kHeartbeat)) vehicle_->autopilot = decode_heartbeat(frame).autopilot;
  return true;
}

std::string VehicleChoice::text_of_vehicle() const {
  return vehicle_ ? text_of_system(vehicle_->system, vehicle_->at) : "no vehicle";
}

void VehicleChoice::note_foreign(const Frame& frame, const net::Peer& from) {
  ++foreign_;
  if (named_.test(frame.system)) return;
  named_.set(frame.system);
  const std::string sender = text_of_system(frame.system, from);
  message_ =
      vehicle_ && vehicle_->system == frame.system
          ? "another autopilot with the same id, " + sender +
                ", is ignored: give each vehicle an id of its own, or configure the address (peer)"
          : "another vehicle, " + sender + ", is ignored: set `system` to choose one";
}

void RateRequests::measure(Instant now) {
  if (!window_began_) window_began_ = now;
  const Duration passed = now - *window_began_;
  if (passed < kMeasured) return;
  measured_hz_ = in_window_ / to_seconds(passed);
  window_began_ = now;
  in_window_ = 0;
}

/// Messages to request in turn, none worse than the one that comes already.
std::vector<MessageId> RateRequests::candidates(std::uint8_t autopilot,
                                                std::optional<MessageId> taken) const {
  if (message_ != MavlinkImuMessage::kBest) return {message_of(message_)};
  if (taken == MessageId::kHighresImu || autopilot == kPx4) return {MessageId::kHighresImu};
  if (autopilot == kArduPilot) return {MessageId::kHighresImu, MessageId::kRawImu};
  return {MessageId::kHighresImu, MessageId::kScaledImu};
}

void RateRequests::append_due(const Target& vehicle, std::uint8_t autopilot,
                              std::optional<MessageId> taken, Instant now, Sender& from,
                              std::vector<std::byte>& out) {
  measure(now);
  if (wanted_hz_ <= 0 || (next_ && now < *next_)) return;
  next_ = now + (requests_sent_ < kOftenTimes ? kOften : kSeldom);
  if (measured_hz_ >= kEnough * wanted_hz_) return;
  if (requests_sent_ == kOftenTimes && !std::exchange(is_reported_, true)) {
    report_ =
        measured_hz_ > 0
            ? "the vehicle sends " + fixed(measured_hz_, 0) + " readings a second, requested " +
                  fixed(wanted_hz_, 0) +
                  ": its link or its loop may be the limit. Set rate_hz to the actual rate, or "
                  "check the stream rates of this port in the autopilot's parameters"
            : "the vehicle sends no IMU readings on request: check the stream rates of this port "
              "in the autopilot's parameters (SRx_RAW_SENS, MAV_x_MODE)";
  }
  const auto all = candidates(autopilot, taken);
  const auto turn = static_cast<std::size_t>(requests_sent_) % (all.size() + 1);
  if (turn < all.size()) {
    encode_message_interval(from, vehicle, all[turn], wanted_hz_, out);
  } else {
    encode_sensor_stream_request(from, vehicle, wanted_hz_, out);
  }
  ++from.sequence;
  ++requests_sent_;
}

}  // namespace fiducap::mavlink
