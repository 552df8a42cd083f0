#include "streaming/mavlink/codec.hpp"

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

}  // namespace fiducap::mavlink
