#include "capture/imu/vehicle_choice.hpp"

#include <chrono>

#include "capture/imu/mavlink_messages.hpp"
#include "middleware/mavlink/messages.hpp"

namespace fiducap::mavlink {

namespace {

constexpr Duration kVehicleGone = std::chrono::seconds(10);
constexpr Duration kMoved = std::chrono::seconds(3);  // then it sends from another port or address

bool is_inertial(const Frame& frame) {
  switch (static_cast<MessageId>(frame.message)) {
    case MessageId::kHighresImu:
    case MessageId::kRawImu:
    case MessageId::kScaledImu:
    case MessageId::kScaledImu2:
    case MessageId::kScaledImu3:
      return true;
    default:
      return false;
  }
}

/// Neither a ground station nor another companion nor a camera.
bool is_of_autopilot(const Frame& frame) {
  if (frame.message != static_cast<std::uint32_t>(MessageId::kHeartbeat)) return is_inertial(frame);
  return decode_heartbeat(frame).autopilot != kNoAutopilot;
}

std::string text_of_sender(const Frame& frame, const LinkPeer& from) {
  const std::string system = "system " + std::to_string(frame.system);
  return from.port == 0 ? system : system + " at " + text_of(from);
}

}  // namespace

std::string_view name_of_autopilot(std::uint8_t autopilot) {
  return autopilot == kPx4 ? "PX4" : autopilot == kArduPilot ? "ArduPilot" : "autopilot";
}

bool VehicleChoice::is_candidate(const Frame& frame) const {
  return is_of_autopilot(frame) && (wanted_ == 0 || frame.system == wanted_);
}

bool VehicleChoice::hear(const Frame& frame, const LinkPeer& from, Instant now, bool may_replace) {
  const bool is_ours = vehicle_ && frame.system == vehicle_->system &&
                       frame.component == vehicle_->component && from == vehicle_->at;
  if (!is_ours) {
    if (!is_of_autopilot(frame)) return false;
    const bool is_same = vehicle_ && frame.system == vehicle_->system;
    const bool is_free =
        !vehicle_ || may_replace || now - vehicle_->heard_at > (is_same ? kMoved : kVehicleGone);
    if (!is_candidate(frame) || !is_free) {
      note_foreign(frame, from);
      return false;
    }
    choose(frame, from, now);
  }
  vehicle_->heard_at = now;
  if (frame.message == static_cast<std::uint32_t>(MessageId::kHeartbeat))
    vehicle_->autopilot = decode_heartbeat(frame).autopilot;
  return true;
}

void VehicleChoice::choose(const Frame& frame, const LinkPeer& from, Instant now) {
  ++turn_;
  vehicle_ = Vehicle{frame.system, frame.component, 0, from, now};
}

std::string VehicleChoice::text_of_vehicle() const {
  if (!vehicle_) return "no vehicle";
  std::string text = "system " + std::to_string(vehicle_->system);
  if (vehicle_->at.port > 0) text.append(" at ").append(text_of(vehicle_->at));
  return text;
}

void VehicleChoice::note_foreign(const Frame& frame, const LinkPeer& from) {
  ++foreign_;
  if (named_.test(frame.system)) return;
  named_.set(frame.system);
  const std::string who = text_of_sender(frame, from);
  if (vehicle_ && vehicle_->system == frame.system) {
    news_ =
        "another autopilot with the same id, " + who +
        ", is left out: give each vehicle an id of its own, or say whose address is meant (peer)";
  } else {
    news_ = "another vehicle, " + who +
            ", speaks here, too, and is left out: `system` says which one is meant";
  }
}

}  // namespace fiducap::mavlink
