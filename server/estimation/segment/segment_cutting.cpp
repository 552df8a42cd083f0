#include "estimation/segment/segment_cutting.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"

namespace fiducap {

namespace {
// Longest time between neighbours for a velocity.
constexpr Duration kSameSpeed = std::chrono::seconds(1);
// Length of a segment with a single instant.
constexpr Duration kShortest = std::chrono::milliseconds(1);

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
    } else if (time > Duration{0} && time <= kSameSpeed) {
      body.v_WB = (to.X_WB.p - from.X_WB.p) / to_seconds(time);
      // The gyro bias contains minus the rate.
      body.bias_w = -log_so3(from.X_WB.q.conjugate() * to.X_WB.q) / to_seconds(time);
    }
    out.push_back(body);
  }
  return out;
}

class Cutter final {
 public:
  explicit Cutter(const PlacedPath& path) : path_(path), chain_(path.chain) {}

  void cut(std::span<const PlacedInstant> chain) {
    const std::vector<BodyMoment> bodies = moments_of(chain, path_.odometry);
    begin(bodies.front());
    if (path_.odometry != nullptr && path_.odometry->covers(chain.front().at))
      open_.up_B =
          path_.odometry->pose_at(chain.front().at).q.conjugate() * Eigen::Vector3d::UnitZ();
    open_.instances.back().images = seen_at(chain.front());
    for (std::size_t i = 1; i < chain.size(); ++i) {
      add(bodies[i], seen_at(chain[i]));
      if (bodies[i].at - open_.begin().at < kSegmentLength && i + 1 < chain.size()) continue;
      end();
      if (i + 1 < chain.size()) begin(bodies[i]);
    }
    if (chain.size() == 1) {
      BodyMoment after = bodies.front();
      after.at += kShortest;
      add(after, {});
      end();
    }
    ++chain_;
  }
  std::vector<MotionSegment> take() { return std::move(done_); }

 private:
  void begin(const BodyMoment& body) {
    open_ = {};
    open_.body_id = path_.body_id;
    open_.chain = chain_;
    open_.anchored = path_.anchored;
    open_.sensors = path_.sensors;
    open_.cameras = path_.cameras;
    open_.instances.push_back({body, {}, {}});
  }

  void add(const BodyMoment& body, std::vector<SegmentImage> images) {
    std::vector<SegmentStep> steps;
    if (path_.odometry != nullptr && path_.odometry->covers(open_.end().at) &&
        path_.odometry->covers(body.at))
      add_odometry(*path_.odometry, open_.end().at, body.at, steps);
    else
      add_steps(body.at - open_.end().at, path_.motion,
                from_seconds(filter_rules::kStepWithoutImu_s), steps);
    open_.instances.push_back({body, std::move(steps), std::move(images)});
  }

  void end() {
    std::set<int> seen;
    for (const MotionSegment::Instance& instance : open_.instances)
      for (const SegmentImage& image : instance.images)
        for (const SegmentSighting& sighting : image.tags) seen.insert(sighting.seen.tag_id);
    for (const int tag_id : seen) open_.tags.push_back(path_.tags.at(tag_id));
    done_.push_back(std::move(open_));
  }

  [[nodiscard]] std::vector<SegmentImage> seen_at(const PlacedInstant& instant) const {
    std::vector<SegmentImage> images = instant.images;
    for (SegmentImage& image : images)
      std::erase_if(image.tags, [&](const auto& s) { return !path_.tags.contains(s.seen.tag_id); });
    std::erase_if(images, [](const SegmentImage& image) { return image.tags.empty(); });
    return images;
  }

  const PlacedPath& path_;
  int chain_;
  MotionSegment open_;
  std::vector<MotionSegment> done_;
};
}  // namespace

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
  Cutter cutter(path);
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
    cutter.cut(std::span(instants).subspan(first, after - first));
    first = after;
  }
  return cutter.take();
}

}  // namespace fiducap
