#include "estimation/segment/segment_cutting.hpp"

#include <algorithm>
#include <utility>

#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"

namespace fiducap {

namespace {
/// Instants of one chain, with speeds.
std::vector<BodyMoment> moments_of(std::span<const PlacedInstant> chain, const Odometry* odometry) {
  std::vector<BodyMoment> out;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    BodyMoment body{.at = chain[i].at, .X_WB = chain[i].X_WB};
    const PlacedInstant& from = chain[i > 0 ? i - 1 : i];
    const PlacedInstant& to = chain[i + 1 < chain.size() ? i + 1 : i];
    const Duration time = to.at - from.at;
    const auto moved =
        odometry != nullptr ? odometry->motion(from.at, to.at) : std::optional<Pose>{};
    if (moved && time > Duration{0}) {
      body.v_WB = from.X_WB.q * moved->p / to_seconds(time);
    } else if (time > Duration{0}) {
      body.v_WB = (to.X_WB.p - from.X_WB.p) / to_seconds(time);
      // The gyro bias contains minus the rate.
      body.bias_w = -log_so3(from.X_WB.q.conjugate() * to.X_WB.q) / to_seconds(time);
    }
    out.push_back(body);
  }
  return out;
}

/// By odometry where it covers both, else by white acceleration.
std::vector<SegmentStep> steps_between(const PlacedPath& path, Instant from, Instant to) {
  std::vector<SegmentStep> steps;
  const Odometry* const odometry = path.odometry;
  if (odometry != nullptr && odometry->covers(from) && odometry->covers(to))
    add_odometry(*odometry, from, to, steps);
  else
    add_steps(to - from, path.motion, from_seconds(filter_rules::kStepWithoutImu_s), steps);
  return steps;
}

/// Appends the segments of one chain.
void cut(const PlacedPath& path, std::span<const PlacedInstant> chain, int number,
         std::vector<MotionSegment>& out) {
  std::vector<BodyMoment> bodies = moments_of(chain, path.odometry);
  // A segment has two ends.
  if (chain.size() == 1) bodies.push_back(bodies.front());
  if (chain.size() == 1) bodies.back().at += from_seconds(filter_rules::kStepWithoutImu_s);
  MotionSegment open = path.head;
  open.chain = number;
  if (path.odometry != nullptr && path.odometry->covers(chain.front().at))
    open.up_B = path.odometry->pose_at(chain.front().at).q.conjugate() * Eigen::Vector3d::UnitZ();
  open.instances.push_back({bodies.front(), {}, chain.front().images});
  for (std::size_t i = 1; i < bodies.size(); ++i) {
    open.instances.push_back({bodies[i], steps_between(path, bodies[i - 1].at, bodies[i].at), {}});
    if (i < chain.size()) open.instances.back().images = chain[i].images;
    if (bodies[i].at - open.begin().at < kSegmentLength && i + 1 < bodies.size()) continue;
    keep_placed(path.tags, open);
    out.push_back(std::exchange(open, path.head));
    open.chain = number;
    open.instances.push_back({bodies[i], {}, {}});
  }
}
}  // namespace

void keep_placed(const std::map<int, KnownTag>& places, MotionSegment& segment) {
  for (const auto& [tag_id, tag] : places) segment.tags.push_back(tag);
  remove_sightings(segment, [&](const auto&, const auto&, const SegmentSighting& one) {
    return !places.contains(one.seen.tag_id);
  });
}

void add_steps(Duration time, const InertialInput& input, Duration longest,
               std::vector<SegmentStep>& steps) {
  while (time > Duration{0}) {
    const Duration step = std::min(time, longest);
    steps.push_back({input, to_seconds(step)});
    time -= step;
  }
}

void add_odometry(const Odometry& odometry, Instant from, Instant to,
                  std::vector<SegmentStep>& steps) {
  const auto& poses = odometry.poses;
  auto next = std::ranges::upper_bound(poses, from, {}, &StampedPose::at);
  StampedPose before{from, odometry.pose_at(from)};
  while (before.at < to) {
    const StampedPose after =
        next != poses.end() && next->at < to ? *next : StampedPose{to, odometry.pose_at(to)};
    const double dt_s = to_seconds(after.at - before.at);
    const Pose moved = before.X_WB.inverse() * after.X_WB;
    InertialInput input;
    input.has_accelerometer = false;
    input.w_B = log_so3(moved.q) / dt_s;
    input.v_B = moved.p / dt_s;
    input.gyro_noise = odometry.turn_noise_rad;
    input.velocity_noise = odometry.move_noise_m;
    steps.push_back({input, dt_s});
    before = after;
    if (next != poses.end()) ++next;
  }
}

std::vector<MotionSegment> cut_segments(const PlacedPath& path) {
  std::vector<MotionSegment> out;
  int chain = path.head.chain;
  const auto& instants = path.instants;
  const auto is_covered = [&](const PlacedInstant& instant) {
    return path.odometry != nullptr && path.odometry->covers(instant.at);
  };
  // A chain ends where odometry begins or ends: velocities have another meaning there.
  const auto is_connected = [&](const PlacedInstant& before, const PlacedInstant& now) {
    if (is_covered(before) != is_covered(now)) return false;
    return is_covered(now) || now.at - before.at <= kLongestBlind;
  };
  for (std::size_t first = 0; first < instants.size();) {
    std::size_t after = first + 1;
    while (after < instants.size() && is_connected(instants[after - 1], instants[after])) ++after;
    cut(path, std::span(instants).subspan(first, after - first), chain++, out);
    first = after;
  }
  return out;
}

}  // namespace fiducap
