#include "streaming/mavlink/vehicle_link.hpp"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>

namespace fiducap::mavlink {

namespace {

void put(LittleEndianWriter& to, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) to.f32(static_cast<float>(v[i]));
}

/// Upper right triangle, row by row.
void put(LittleEndianWriter& to, const Matrix6d& covariance) {
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column)
      to.f32(static_cast<float>(covariance(row, column)));
  }
}

constexpr Duration kSilence = std::chrono::seconds(3);

bool is_usable(const BodyPose& body) {
  return body.valid && body.X_WP.p.allFinite() && body.X_WP.q.coeffs().allFinite() &&
         body.v_WP.allFinite() && body.w_WP_P.allFinite() && body.covariance.allFinite();
}

}  // namespace

void encode_odometry(const Sender& from, const PoseReport& report, std::vector<std::byte>& out) {
  const AutopilotOdometry& odometry = report.odometry;
  append_frame(from, MessageId::kOdometry, out, [&](LittleEndianWriter& to) {
    to.u64(report.time_us);
    put(to, odometry.p_NF);
    const Eigen::Quaterniond& q = odometry.q_NF;
    for (const double part : {q.w(), q.x(), q.y(), q.z()}) to.f32(static_cast<float>(part));
    put(to, odometry.v_NF_F);
    put(to, odometry.w_NF_F);
    put(to, odometry.pose_covariance);
    put(to, odometry.twist_covariance);
    to.u8(report.world == AutopilotWorld::kNed ? kFrameLocalNed : kFrameLocalFrd).u8(kFrameBodyFrd);
    to.u8(report.reset_counter).u8(kEstimatorMocap).u8(static_cast<std::uint8_t>(report.quality));
  });
}

void encode_vision_position(const Sender& from, const PoseReport& report,
                            std::vector<std::byte>& out) {
  append_frame(from, MessageId::kVisionPositionEstimate, out, [&](LittleEndianWriter& to) {
    to.u64(report.time_us);
    put(to, report.odometry.p_NF);
    put(to, roll_pitch_yaw(report.odometry.q_NF));
    put(to, report.odometry.pose_covariance);
    to.u8(report.reset_counter);
  });
}

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
          sync_.accept_reply(timesync, now);
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
  if (heartbeats_.is_due(frame.at, frame.rate_hz))
    encode_heartbeat(next_sender(),
                     {kOnboardController, kNoAutopilot, usable ? kStateActive : kStateStandby},
                     out);
  if (const auto request = sync_.next_request(now)) encode_timesync(next_sender(), *request, out);
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
