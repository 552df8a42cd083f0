#include "streaming/vrpn/report_encoder.hpp"

#include <algorithm>
#include <numbers>

#include "base/so3.hpp"
#include "streaming/vrpn/codec.hpp"

namespace fiducap::vrpn {

namespace {

const Pose kAtPivot{Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()};
// A turn of pi or more within dt would be read as one the other way round.
constexpr double kLargestTurn_rad = 0.9 * std::numbers::pi;

double turn_time_s(double rate_rad_s) {
  return rate_rad_s <= kLargestTurn_rad ? 1.0 : kLargestTurn_rad / rate_rad_s;
}

Header header_of(std::int64_t utc_ns, std::int32_t sender, Type type) {
  return {utc_ns, sender, static_cast<std::int32_t>(type), 0};
}

}  // namespace

std::size_t EncodedFrame::equal_cut() const {
  if (datagram_ends.size() < 2) return 0;
  const std::size_t cut = datagram_ends.front();
  for (std::size_t i = 0; i + 1 < datagram_ends.size(); ++i) {
    if (datagram_ends[i] != (i + 1) * cut) return 0;
  }
  return bytes.size() - datagram_ends[datagram_ends.size() - 2] <= cut ? cut : 0;
}

void ReportEncoder::encode(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
                           std::span<const std::vector<Pose>> sensors_of_body,
                           EncodedFrame& out) const {
  out.bytes.clear();
  out.datagram_ends.clear();
  const std::int64_t utc_ns = frame.utc_ns();
  const std::size_t count = std::min(frame.bodies.size(), sender_of_body.size());
  std::size_t datagram_begin = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (!frame.bodies[i].valid || sender_of_body[i] < 0) continue;
    const std::size_t body_begin = out.bytes.size();
    const BodyPose& body = frame.bodies[i];
    append(body, kAtPivot, {utc_ns, sender_of_body[i], 0}, out.bytes);
    if (i < sensors_of_body.size()) {
      int sensor = 0;
      for (const Pose& X_PS : sensors_of_body[i]) {
        append(body, X_PS, {utc_ns, sender_of_body[i], ++sensor}, out.bytes);
      }
    }
    if (out.bytes.size() - datagram_begin >
        kMaxDatagram) {  // the reports of one body stay together
      out.datagram_ends.push_back(body_begin);
      datagram_begin = body_begin;
    }
  }
  if (out.bytes.size() > datagram_begin) out.datagram_ends.push_back(out.bytes.size());
}

void ReportEncoder::append(const BodyPose& body, const Pose& X_PS, const Stamp& stamp,
                           std::vector<std::byte>& out) const {
  const auto header = [&](Type type) { return header_of(stamp.utc_ns, stamp.sender, type); };
  const Eigen::Quaterniond& q_WP = body.X_WP.q;
  const Pose X = axes_.pose({q_WP * X_PS.q, body.X_WP.p + q_WP * X_PS.p});
  // Clients hand NaN on to their users unchecked.
  if (!X.p.allFinite() || !X.q.coeffs().allFinite()) return;
  encode_pos_quat(header(Type::kPosQuat), stamp.sensor, X, out);
  const Eigen::Vector3d lever = body.w_WP_P.cross(X_PS.p);
  const Eigen::Vector3d v = axes_.length(body.v_WP + q_WP * lever);
  const Eigen::Vector3d w = axes_.world_rate(q_WP * body.w_WP_P);
  if (content_.velocity && v.allFinite() && w.allFinite()) {
    const double dt_s = turn_time_s(w.norm());
    encode_rate(header(Type::kVelocity), stamp.sensor, v, exp_so3(w * dt_s), dt_s, out);
  }
  const Eigen::Vector3d a = axes_.length(body.a_WP + q_WP * body.w_WP_P.cross(lever));
  if (content_.acceleration && a.allFinite()) {
    encode_rate(header(Type::kAcceleration), stamp.sensor, a, Eigen::Quaterniond::Identity(), 1.0,
                out);
  }
}

}  // namespace fiducap::vrpn
