#include "streaming/mavlink/vehicle_link.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "streaming/mavlink/codec.hpp"

namespace fiducap::mavlink {

namespace {

constexpr Duration kSilence = std::chrono::seconds(3);

bool is_usable(const BodyPose& body) {
  return body.valid && body.X_WP.p.allFinite() && body.X_WP.q.coeffs().allFinite() &&
         body.v_WP.allFinite() && body.w_WP_P.allFinite() && body.covariance.allFinite();
}

}  // namespace

VehicleLink::VehicleLink(const VehicleConfig& config)
    : config_(config), schedule_(config.rate_hz) {}

Sender VehicleLink::next_sender() {
  return {static_cast<std::uint8_t>(config_.system_id),
          static_cast<std::uint8_t>(config_.component_id), sequence_++};
}

void VehicleLink::receive(std::span<const std::byte> datagram, Instant now,
                          std::vector<std::byte>& answers) {
  const std::size_t room = datagram.size();
  const std::size_t start = answers.size();
  while (const auto frame = next_frame(datagram)) {
    switch (static_cast<MessageId>(frame->message)) {
      case MessageId::kHeartbeat:
        if (decode_heartbeat(*frame).autopilot == kNoAutopilot)
          break;  // another companion, a ground station
        heard_at_ = now;
        heard_system_ = frame->system;
        break;
      case MessageId::kTimesync: {
        const Timesync timesync = decode_timesync(*frame);
        if (timesync.tc1_ns != 0) {
          sync_.answer(timesync, now);
          break;
        }
        const std::size_t before = answers.size();
        encode_timesync(next_sender(), {to_ns(now), timesync.ts1_ns}, answers);
        if (answers.size() - start > room) answers.resize(before);
        break;
      }
      default:
        break;
    }
  }
}

void VehicleLink::publish(const SceneFrame& frame, const BodyPose* body, std::uint32_t jumps,
                          Instant now, std::vector<std::byte>& out) {
  const bool usable = body != nullptr && is_usable(*body);
  if (usable && schedule_.is_due(frame.at, frame.rate_hz)) publish_pose(frame, *body, jumps, out);
  if (heartbeats_.is_due(frame.at, frame.rate_hz)) {
    encode_heartbeat(next_sender(),
                     {kOnboardController, kNoAutopilot, usable ? kStateActive : kStateStandby},
                     out);
  }
  if (const auto question = sync_.question(now)) encode_timesync(next_sender(), *question, out);
}

void VehicleLink::publish_pose(const SceneFrame& frame, const BodyPose& body, std::uint32_t jumps,
                               std::vector<std::byte>& out) {
  const PoseReport report{
      static_cast<std::uint64_t>(std::max<std::int64_t>(to_ns(frame.at), 0) / 1000), config_.world,
      to_autopilot(body, config_.world), static_cast<std::uint8_t>(jumps), autopilot_quality(body)};
  if (config_.message != PoseMessage::kVisionPosition) encode_odometry(next_sender(), report, out);
  if (config_.message != PoseMessage::kOdometry) encode_vision_position(next_sender(), report, out);
  ++poses_;
}

std::string VehicleLink::status(Instant now) const {
  std::string text =
      fmt::format("{}, {} {:.0f} Hz", config_.body,
                  config_.world == AutopilotWorld::kNed ? "ned" : "frd", config_.rate_hz);
  if (!heard_at_ || now - *heard_at_ > kSilence) return text + ", no heartbeat of an autopilot";
  text += fmt::format(", system {}", heard_system_);
  return text;
}

}  // namespace fiducap::mavlink
