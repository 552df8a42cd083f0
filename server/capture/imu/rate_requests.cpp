#include "capture/imu/rate_requests.hpp"

#include <chrono>

#include "base/text.hpp"

namespace fiducap::mavlink {

namespace {

constexpr Duration kMeasured = std::chrono::seconds(1);
constexpr Duration kOften = std::chrono::seconds(1);
constexpr Duration kSeldom = std::chrono::seconds(10);
constexpr int kOftenTimes = 6;
constexpr double kEnough = 0.8;  // of what was asked: autopilots divide their loop by whole numbers

MessageId id_of(MavlinkImuMessage message) {
  switch (message) {
    case MavlinkImuMessage::kRaw:
      return MessageId::kRawImu;
    case MavlinkImuMessage::kScaled:
      return MessageId::kScaledImu;
    case MavlinkImuMessage::kScaled2:
      return MessageId::kScaledImu2;
    case MavlinkImuMessage::kScaled3:
      return MessageId::kScaledImu3;
    case MavlinkImuMessage::kBest:
    case MavlinkImuMessage::kHighres:
      break;
  }
  return MessageId::kHighresImu;
}

}  // namespace

void RateRequests::count(Instant now) {
  measure(now);
  ++in_window_;
}

void RateRequests::measure(Instant now) {
  if (!window_began_) window_began_ = now;
  const Duration passed = now - *window_began_;
  if (passed < kMeasured) return;
  measured_hz_ = in_window_ / to_seconds(passed);
  window_began_ = now;
  in_window_ = 0;
}

void RateRequests::begin_anew() {
  window_began_.reset();
  in_window_ = asked_ = 0;
  measured_hz_ = 0;
  next_.reset();
  told_ = false;
}

/// What may be asked for, in turn; what comes already is not changed for something worse.
std::vector<MessageId> RateRequests::candidates(std::uint8_t autopilot,
                                                std::optional<MessageId> taken) const {
  if (message_ != MavlinkImuMessage::kBest) return {id_of(message_)};
  if (taken == MessageId::kHighresImu || autopilot == kPx4) return {MessageId::kHighresImu};
  if (autopilot == kArduPilot) return {MessageId::kHighresImu, MessageId::kRawImu};
  return {MessageId::kHighresImu, MessageId::kScaledImu};
}

void RateRequests::append_due(const Target& vehicle, std::uint8_t autopilot,
                              std::optional<MessageId> taken, Instant now, Sender& from,
                              std::vector<std::byte>& out) {
  measure(now);
  if (wanted_hz_ <= 0 || (next_ && now < *next_)) return;
  next_ = now + (asked_ < kOftenTimes ? kOften : kSeldom);
  if (measured_hz_ >= kEnough * wanted_hz_) return;
  if (asked_ == kOftenTimes && !std::exchange(told_, true)) {
    news_ =
        measured_hz_ > 0
            ? "the vehicle sends " + fixed(measured_hz_, 0) + " readings a second, asked for " +
                  fixed(wanted_hz_, 0) +
                  ": its link or its loop may not do more. Set rate_hz to what it does, or look "
                  "at the stream rates of this port in the autopilot's parameters"
            : "the vehicle sends no IMU readings although it was asked: look at the stream rates "
              "of this port in the autopilot's parameters (SRx_RAW_SENS, MAV_x_MODE)";
  }
  const auto all = candidates(autopilot, taken);
  const auto turn = static_cast<std::size_t>(asked_) % (all.size() + 1);
  if (turn < all.size()) {
    encode_message_interval(from, vehicle, all[turn], wanted_hz_, out);
  } else {
    encode_sensor_stream_request(from, vehicle, wanted_hz_, out);
  }
  ++from.sequence;
  ++asked_;
}

}  // namespace fiducap::mavlink
