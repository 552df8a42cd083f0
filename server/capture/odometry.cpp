#include "capture/odometry.hpp"

#include <algorithm>

namespace fiducap {
namespace {

// Further apart nobody knows what the body did between two poses.
constexpr Duration kLongestGap = std::chrono::seconds(2);

auto not_before(const std::vector<StampedPose>& poses, Instant at) {
  return std::lower_bound(poses.begin(), poses.end(), at,
                          [](const StampedPose& pose, Instant t) { return pose.at < t; });
}

}  // namespace

bool Odometry::covers(Instant at) const {
  if (poses.empty() || at < poses.front().at || poses.back().at < at) return false;
  const auto after = not_before(poses, at);
  return after->at == at || after->at - std::prev(after)->at <= kLongestGap;
}

Pose Odometry::pose_at(Instant at) const {
  const auto after = not_before(poses, at);
  if (after == poses.begin() || after->at == at) return after->X_WB;
  const StampedPose& a = *std::prev(after);
  const StampedPose& b = *after;
  const double share = to_seconds(at - a.at) / to_seconds(b.at - a.at);
  return {a.X_WB.q.slerp(share, b.X_WB.q), a.X_WB.p + share * (b.X_WB.p - a.X_WB.p)};
}

std::optional<Pose> Odometry::motion(Instant from, Instant to) const {
  if (!covers(from) || !covers(to)) return std::nullopt;
  return pose_at(from).inverse() * pose_at(to);
}

}  // namespace fiducap
