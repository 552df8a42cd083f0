#include "streaming/vrpn/report_encoder.hpp"

#include <algorithm>
#include <numbers>

#include "base/so3.hpp"
#include "streaming/vrpn/codec.hpp"

namespace fiducap::vrpn {

namespace {

constexpr int kSensor = 0;
// A turn of pi or more within dt would be read as one the other way round.
constexpr double kLargestTurn_rad = 0.9 * std::numbers::pi;

double turn_time_s(double rate_rad_s) {
  return rate_rad_s <= kLargestTurn_rad ? 1.0 : kLargestTurn_rad / rate_rad_s;
}

Header header_of(std::int64_t utc_ns, std::int32_t sender, Type type) {
  return {utc_ns, sender, static_cast<std::int32_t>(type), 0};
}

}  // namespace

void ReportEncoder::encode(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
                           EncodedFrame& out) const {
  out.bytes.clear();
  out.datagram_ends.clear();
  const std::int64_t utc_ns = frame.utc_ns();
  const std::size_t count = std::min(frame.bodies.size(), sender_of_body.size());
  std::size_t datagram_begin = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (!frame.bodies[i].valid || sender_of_body[i] < 0) continue;
    const std::size_t body_begin = out.bytes.size();
    append(frame.bodies[i], utc_ns, sender_of_body[i], out.bytes);
    if (out.bytes.size() - datagram_begin > kMaxDatagram) {  // the reports of one body stay together
      out.datagram_ends.push_back(body_begin);
      datagram_begin = body_begin;
    }
  }
  if (out.bytes.size() > datagram_begin) out.datagram_ends.push_back(out.bytes.size());
}

void ReportEncoder::append(const BodyPose& body, std::int64_t utc_ns, std::int32_t sender,
                           std::vector<std::byte>& out) const {
  const Pose X = axes_.pose(body.X_WP);
  // Clients hand NaN on to their users unchecked.
  if (!X.p.allFinite() || !X.q.coeffs().allFinite()) return;
  encode_pos_quat(header_of(utc_ns, sender, Type::kPosQuat), kSensor, X, out);
  const Eigen::Vector3d v = axes_.length(body.v_WP);
  const Eigen::Vector3d w = axes_.world_rate(body.X_WP.q * body.w_WP_P);
  if (content_.velocity && v.allFinite() && w.allFinite()) {
    const double dt_s = turn_time_s(w.norm());
    encode_rate(header_of(utc_ns, sender, Type::kVelocity), kSensor, v, exp_so3(w * dt_s), dt_s, out);
  }
  const Eigen::Vector3d a = axes_.length(body.a_WP);
  if (content_.acceleration && a.allFinite()) {
    encode_rate(header_of(utc_ns, sender, Type::kAcceleration), kSensor, a, Eigen::Quaterniond::Identity(), 1.0,
                out);
  }
}

}  // namespace fiducap::vrpn
