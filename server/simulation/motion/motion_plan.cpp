#include "simulation/motion/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/pose.hpp"
#include "simulation/random.hpp"
#include "simulation/room_shape.hpp"

namespace fiducap::simulation {

namespace {

using std::numbers::pi;

/// A sum of three slow sinusoids per axis, periodic in one round.
class Sway final {
 public:
  Sway(Random& random, int slowest, int fastest, const Eigen::Vector3d& amplitude)
      : amplitude_(amplitude) {
    for (auto& axis : waves_) {
      for (auto& wave : axis)
        wave = {static_cast<double>(slowest + random.below(fastest - slowest + 1)),
                random.uniform(0, 2 * pi)};
    }
  }
  /// @param round  0..1 of the closed motion
  [[nodiscard]] Eigen::Vector3d at(double round) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      for (const Wave& wave : waves_[static_cast<std::size_t>(axis)])
        sum(axis) += std::sin(2 * pi * wave.turns * round + wave.phase) / 2.0;
    }
    return sum.cwiseProduct(amplitude_);
  }

 private:
  struct Wave {
    double turns;
    double phase;
  };
  std::array<std::array<Wave, 3>, 3> waves_{};
  Eigen::Vector3d amplitude_;
};

/// Poses at equal steps of time along straight legs, each as fast as the limits allow.
std::vector<Pose> walk_through(const std::vector<Pose>& waypoints, double speed, double rate,
                               double spacing_s) {
  std::vector<double> arrival{0.0};
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const Pose& from = waypoints[i];
    const Pose& to = waypoints[(i + 1) % waypoints.size()];
    const double leg = std::max((to.p - from.p).norm() / speed, angle_between(from.q, to.q) / rate);
    arrival.push_back(arrival.back() + std::max(leg, 0.25 * spacing_s));
  }
  const int steps = std::max(12, static_cast<int>(std::ceil(arrival.back() / spacing_s)));
  std::vector<Pose> poses;
  std::size_t leg = 0;
  for (int k = 0; k < steps; ++k) {
    const double t = arrival.back() * k / steps;
    while (leg + 2 < arrival.size() && t >= arrival[leg + 1]) ++leg;
    const double share = (t - arrival[leg]) / (arrival[leg + 1] - arrival[leg]);
    const Pose& from = waypoints[leg];
    const Pose& to = waypoints[(leg + 1) % waypoints.size()];
    poses.push_back({from.q.slerp(share, to.q), (1 - share) * from.p + share * to.p});
  }
  return poses;
}

/// Smooths a closed path: each pose moves half way to its neighbours, `passes` times.
void smooth(std::vector<Pose>& poses, int passes) {
  for (int pass = 0; pass < passes; ++pass) {
    const std::vector<Pose> old = poses;
    const std::size_t n = old.size();
    for (std::size_t i = 0; i < n; ++i) {
      const Pose& before = old[(i + n - 1) % n];
      const Pose& after = old[(i + 1) % n];
      poses[i].p = 0.25 * before.p + 0.5 * old[i].p + 0.25 * after.p;
      poses[i].q = old[i].q.slerp(0.5, before.q.slerp(0.5, after.q));
    }
  }
}

void sway(std::vector<Pose>& poses, Random& random, const Eigen::Vector3d& shift_m,
          const Eigen::Vector3d& turn_rad, double spacing_s) {
  // Periods of 3 to 8 s for any length of the round.
  const double round_s = spacing_s * static_cast<double>(poses.size());
  const int slowest = std::max(1, static_cast<int>(round_s / 8));
  const int fastest = std::max(slowest + 1, static_cast<int>(round_s / 3));
  const Sway shift(random, slowest, fastest, shift_m);
  const Sway turn(random, slowest, fastest, turn_rad);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double round = static_cast<double>(i) / static_cast<double>(poses.size());
    poses[i] = poses[i] * Pose{exp_so3(turn.at(round)), shift.at(round)};
  }
}

Eigen::Vector3d up_for(const Eigen::Vector3d& viewing) {
  // A vertical view has the image top along the room's y axis.
  return std::abs(viewing.normalized().z()) > 0.9 ? Eigen::Vector3d::UnitY()
                                                  : Eigen::Vector3d::UnitZ();
}

/// A view of a tag from 5 to 8 edges away and a little aside.
Pose view_of(const RecordedTag& tag, Random& random) {
  const Eigen::Vector3d normal = tag.X_WT.q * Eigen::Vector3d::UnitZ();
  const double distance = tag.edge_m * random.uniform(5.0, 8.0);
  Eigen::Vector3d p = tag.X_WT * (distance * random.inside({-0.25, -0.25, 1}, {0.25, 0.25, 1}));
  if (std::abs(normal.z()) < 0.5)
    p.z() = std::clamp(p.z(), tag.X_WT.p.z() - 0.4, tag.X_WT.p.z() + 0.4);
  return look_at(p, tag.X_WT.p, up_for(tag.X_WT.p - p));
}

/// Tags by their bearing from the centre of all tags: a walk along the walls.
std::vector<RecordedTag> by_bearing(std::vector<RecordedTag> tags) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const RecordedTag& tag : tags) middle += tag.X_WT.p / static_cast<double>(tags.size());
  const auto bearing = [&](const RecordedTag& tag) {
    return std::atan2(tag.X_WT.p.y() - middle.y(), tag.X_WT.p.x() - middle.x());
  };
  std::ranges::stable_sort(
      tags, [&](const RecordedTag& a, const RecordedTag& b) { return bearing(a) < bearing(b); });
  return tags;
}

struct Limits {
  double speed_m_s, rate_rad_s, acceleration_m_s2;
};

MotionPlan finish(const std::vector<Pose>& waypoints, Random& random, double spacing_s,
                  const Limits& limits, const Eigen::Vector3d& shift_m,
                  const Eigen::Vector3d& turn_rad) {
  MotionPlan plan{walk_through(waypoints, limits.speed_m_s, limits.rate_rad_s, spacing_s),
                  spacing_s, limits.speed_m_s, limits.rate_rad_s, limits.acceleration_m_s2};
  smooth(plan.X_WV, 2);
  sway(plan.X_WV, random, shift_m, turn_rad, spacing_s);
  return plan;
}

MotionPlan survey(std::uint64_t seed, const RoomConfig& room) {
  Random random(seed, Purpose::kMotion);
  std::vector<RecordedTag> tags = by_bearing(tags_of(room));
  if (random.chance(0.5)) std::reverse(tags.begin(), tags.end());
  std::rotate(tags.begin(), tags.begin() + random.below(static_cast<int>(tags.size())), tags.end());
  // Few tags are viewed from several places each; of many, some are skipped.
  constexpr std::size_t kFewest = 9;
  const std::size_t rounds = (kFewest + tags.size() - 1) / tags.size();
  std::vector<Pose> waypoints;
  for (std::size_t round = 0; round < rounds; ++round) {
    std::size_t i = 0;
    while (i < tags.size()) {
      waypoints.push_back(view_of(tags[i], random));
      i += rounds == 1 && random.chance(0.5) ? 2 : 1;
    }
  }
  return finish(waypoints, random, 0.5, {0.9, 0.9, 1.5}, {0.06, 0.06, 0.04}, {0.05, 0.06, 0.05});
}

MotionPlan hover(std::uint64_t seed, const RoomConfig& room) {
  Random random(seed, Purpose::kMotion);
  const std::vector<RecordedTag> tags = tags_of(room);
  const Pose place =
      view_of(tags[static_cast<std::size_t>(random.below(static_cast<int>(tags.size())))], random);
  MotionPlan plan{std::vector<Pose>(120, place), 0.5, 0.25, 0.25, 1.0};
  sway(plan.X_WV, random, {0.08, 0.08, 0.08}, {0.04, 0.04, 0.06}, plan.spacing_s);
  return plan;
}

MotionPlan table(std::uint64_t seed) {
  Random random(seed, Purpose::kMotion);
  const Eigen::Vector3d middle(0.2, -0.12, 0);
  std::vector<Pose> waypoints;
  for (int i = 0; i < 24; ++i) {
    const Eigen::Vector3d p = middle + random.inside({-0.35, -0.35, 0.75}, {0.35, 0.35, 1.15});
    const Eigen::Vector3d target = middle + random.inside({-0.25, -0.12, 0}, {0.25, 0.12, 0});
    const double turn = random.uniform(-0.5, 0.5);
    waypoints.push_back(look_at(p, target, {std::sin(turn), std::cos(turn), 0}));
  }
  return finish(waypoints, random, 0.5, {0.5, 0.8, 1.5}, {0.02, 0.02, 0.02}, {0.03, 0.03, 0.03});
}

MotionPlan sparse(std::uint64_t seed, const RoomConfig& room) {
  Random random(seed, Purpose::kMotion);
  const std::vector<RecordedTag> tags = tags_of(room);
  std::vector<Pose> waypoints;
  constexpr int kLooks = 60;
  int looked_at = 0;
  for (int i = 0; i < kLooks; ++i) {
    // Every second view keeps the tag; between tags the camera sees empty space.
    if (random.chance(0.5)) looked_at = random.below(static_cast<int>(tags.size()));
    const RecordedTag& tag = tags[static_cast<std::size_t>(looked_at)];
    const double distance = random.uniform(1.3, 2.4);
    const Eigen::Vector3d p =
        tag.X_WT * (distance * random.inside({-0.45, -0.45, 1}, {0.45, 0.45, 1}));
    const Eigen::Vector3d past = random.inside({-0.6, -0.6, -0.3}, {0.6, 0.6, 0.3});
    const Eigen::Vector3d up = random.inside({-0.2, -0.2, 1}, {0.2, 0.2, 1});
    waypoints.push_back(look_at(p, tag.X_WT.p + past, up));
  }
  return finish(waypoints, random, 0.3, {1.8, 2.0, 5.0}, {0.05, 0.05, 0.05}, {0.08, 0.08, 0.1});
}

/// @param distance_m  along the loop
Pose view_along(const LoopShape& shape, double distance_m) {
  const LoopPoint at = loop_at(shape, distance_m);
  const Eigen::Vector3d ahead(-at.outward.y(), at.outward.x(), 0);
  return look_at(at.p, at.p + at.outward + 0.7 * ahead, Eigen::Vector3d::UnitZ());
}

MotionPlan loop(const TrajectoryConfig& config, const RoomConfig& room) {
  Random random(config.seed, Purpose::kMotion);
  constexpr double kSpeed_m_s = 1.15;
  constexpr int kSteps = 120;
  const LoopShape shape = loop_of(room);
  const bool is_round = config.share >= 1;
  const double walked_m = shape.length_m * (is_round ? 1.0 : 2 * config.share);
  MotionPlan plan{{}, walked_m / kSpeed_m_s / kSteps, 0, 0, 0};
  for (int i = 0; i < kSteps; ++i) {
    const double gone = i * walked_m / kSteps;
    const double out = is_round ? gone : std::min(gone, walked_m - gone);
    plan.X_WV.push_back(view_along(shape, config.from * shape.length_m + out));
  }
  if (!is_round) smooth(plan.X_WV, 3);  // rounds the turning points
  sway(plan.X_WV, random, {0.05, 0.1, 0.1}, {0.06, 0.06, 0.06}, plan.spacing_s);
  return plan;
}

MotionPlan ceiling(std::uint64_t seed) {
  Random random(seed, Purpose::kMotion);
  std::vector<Pose> waypoints;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d p = random.inside({-4, -4, 0.8}, {4, 4, 1.4});
    const Eigen::Vector3d above = p + random.inside({-0.2, -0.2, 1}, {0.2, 0.2, 1});
    const double turn = random.uniform(-1.0, 1.0);
    waypoints.push_back(look_at(p, above, {std::sin(turn), std::cos(turn), 0}));
  }
  return finish(waypoints, random, 0.4, {1.8, 1.5, 3.0}, {0.05, 0.05, 0.05}, {0.05, 0.05, 0.05});
}

}  // namespace

Pose look_at(const Eigen::Vector3d& p, const Eigen::Vector3d& target, const Eigen::Vector3d& up) {
  Eigen::Matrix3d R_WV;
  R_WV.col(2) = (target - p).normalized();
  R_WV.col(0) = R_WV.col(2).cross(up).normalized();
  R_WV.col(1) = R_WV.col(2).cross(R_WV.col(0));
  return {Eigen::Quaterniond(R_WV), p};
}

std::optional<MotionPlan> plan_motion(const TrajectoryConfig& config, const RoomConfig& room) {
  if (config.kind == "table") return table(config.seed);
  if (config.kind == "loop") return loop(config, room);
  if (config.kind == "ceiling") return ceiling(config.seed);
  if (config.kind == "survey") return survey(config.seed, room);
  if (config.kind == "hover") return hover(config.seed, room);
  if (config.kind == "sparse") return sparse(config.seed, room);
  return std::nullopt;
}

}  // namespace fiducap::simulation
