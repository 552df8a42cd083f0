// Changes that reviews asked for: sensors, mounts, corners, and maps of other days.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "simulation/filter_run.hpp"
#include "simulation/mismatch_changes.hpp"
#include "simulation/random.hpp"
#include "simulation/room_shape.hpp"

namespace fiducap::mismatch {

namespace {

using simulation::Purpose;
using simulation::Random;

// Keys of random numbers, apart from those of the simulator and of the other changes.
constexpr std::uint64_t kMount = 9'011;
constexpr std::uint64_t kTail = 9'012;
constexpr std::uint64_t kAlone = 9'013;
constexpr std::uint64_t kMap = 9'014;
constexpr std::uint64_t kAxis = 9'015;

constexpr double kExact_m = 1e-4;
constexpr double kExact_rad = 1e-4;
constexpr double kKept_m = 2e-3;
constexpr double kKept_rad = 2e-3;
constexpr double kMovedOvernight_m = 0.3;
constexpr double kTurnedOvernight_rad = 10 * kDegree;
// A tag that is seen alone must have been known before.
constexpr std::size_t kImagesBefore = 10;
constexpr std::size_t kCandidates = 8;

/// Times of the images that show a tag.
std::vector<double> times_of(EstimationData& data, int tag_id) {
  std::vector<double> times;
  for_images(data, [&](const CornerFrame& image, std::size_t, double t_s) {
    if (shows(image, tag_id)) times.push_back(t_s);
  });
  return times;
}

std::size_t count_in(const std::vector<double>& times, double from_s, double to_s) {
  return static_cast<std::size_t>(std::ranges::lower_bound(times, to_s) -
                                  std::ranges::lower_bound(times, from_s));
}

/// A tag, and the beginning of an outage in which it is moved.
struct MovedAlone {
  int tag_id{-1};
  double from_s{};
  std::size_t seen{};  ///< Images with it after the outage.
};

MovedAlone most_seen_alone(EstimationData& data, const Eigen::Vector3d& by_m, double window_s,
                           std::uint64_t seed) {
  constexpr double kStep_s = 0.5;
  MovedAlone best;
  for (const int id : often_seen(data, kCandidates)) {
    Pose moved = data.tag(id)->X_WT;
    moved.p += by_m;
    EstimationData after = data;
    carry(
        after, id, 0, [&](double) { return moved; }, seed + kAlone);
    const std::vector<double> here = times_of(data, id);
    const std::vector<double> there = times_of(after, id);
    const double last_s = length_s(data) - 2.5 * window_s;
    for (double from_s = window_s; from_s < last_s; from_s += kStep_s) {
      if (count_in(here, 0, from_s) < kImagesBefore) continue;
      const std::size_t seen = count_in(there, from_s + window_s, from_s + 2 * window_s);
      if (seen > best.seen) best = {id, from_s, seen};
    }
  }
  return best;
}

/// The instant after `from` at which the body is nearest to 2 m away, and turned most.
Instant elsewhere(const EstimationData& data, Instant from, Instant to) {
  constexpr double kAway_m = 2;
  const Pose X_WB = data.truth_near(from).X_WB;
  const auto cost = [&](const TruthSample& at) {
    const double turned_rad = log_so3(X_WB.q.conjugate() * at.X_WB.q).norm();
    return std::abs((at.X_WB.p - X_WB.p).norm() - kAway_m) - turned_rad / std::numbers::pi;
  };
  const TruthSample* best = nullptr;
  for (const TruthSample& at : data.truth) {
    if (at.at < from || at.at > to) continue;
    if (best == nullptr || cost(at) < cost(*best)) best = &at;
  }
  return best->at;
}

Pose displaced(const Pose& X_AB, double by_m, double by_rad, Random& random) {
  const Eigen::Vector3d along = random.normal3().normalized();
  const Eigen::Vector3d about = random.normal3().normalized();
  return {exp_so3(by_rad * about) * X_AB.q, X_AB.p + by_m * along};
}

}  // namespace

Eigen::Vector3d random_axis(std::uint64_t seed) {
  return Random(seed, Purpose::kImuErrors, kAxis).normal3().normalized();
}

void drift_gyro(EstimationData& data, double rad_s2) {
  const Instant first = time_of(data.samples.front());
  const auto drift = [&](Instant at) { return rad_s2 * to_seconds(at - first); };
  for_imu(data, [&](ImuSample& imu) { imu.w_WB_B.z() += drift(imu.sampled_at); });
  for (TruthSample& at : data.truth) at.bias_w.z() += drift(at.at);
}

void take_lift(EstimationData& data, double from_s) {
  constexpr double kAcceleration_m_s2 = 0.5;
  constexpr double kSpeedsUp_s = 2;
  constexpr double kEven_s = 3;
  const Instant from = time_of(data.samples.front()) + from_seconds(from_s);
  for_imu(data, [&](ImuSample& imu) {
    const double t_s = to_seconds(imu.sampled_at - from);
    const bool slows = t_s >= kSpeedsUp_s + kEven_s && t_s < 2 * kSpeedsUp_s + kEven_s;
    double up_m_s2 = slows ? -kAcceleration_m_s2 : 0;
    if (t_s >= 0 && t_s < kSpeedsUp_s) up_m_s2 = kAcceleration_m_s2;
    const Eigen::Quaterniond q_WB = data.truth_near(imu.sampled_at).X_WB.q;
    imu.f_B += up_m_s2 * (q_WB.conjugate() * Eigen::Vector3d::UnitZ());
  });
}

void carry_asleep(EstimationData& data, double from_s) {
  constexpr double kAsleep_s = 8;
  constexpr double kLeast_s = 1;
  const Instant first = time_of(data.samples.front());
  const Instant from = first + from_seconds(from_s);
  const Instant to =
      elsewhere(data, from + from_seconds(kLeast_s), first + from_seconds(0.7 * length_s(data)));
  const Duration later = from_seconds(kAsleep_s) - (to - from);
  const auto is_cut = [&](Instant at) { return at > from && at < to; };
  std::erase_if(data.samples, [&](const SensorSample& s) { return is_cut(time_of(s)); });
  std::erase_if(data.truth, [&](const TruthSample& t) { return is_cut(t.at); });
  for_imu(data, [&](ImuSample& imu) {
    if (imu.sampled_at >= to) imu.sampled_at += later;
  });
  for_each_image(data, [&](CornerFrame& image) {
    if (image.exposed_at >= to) image.exposed_at += later;
  });
  for (TruthSample& at : data.truth)
    if (at.at >= to) at.at += later;
}

void displace_configured_camera(EstimationData& data, double by_m, double by_rad,
                                std::uint64_t seed) {
  Random random(seed, Purpose::kRoom, kMount);
  data.nominal_X_BV = displaced(data.camera.X_BV, by_m, by_rad, random);
  data.camera.position_sigma_m = kExact_m;
  data.camera.rotation_sigma_rad = kExact_rad;
}

void scatter_corners(EstimationData& data, double share, double sigma_px, std::uint64_t seed) {
  Random random(seed, Purpose::kCornerFaults, kTail);
  for_images(data, [&](CornerFrame& image, std::size_t, double) {
    const Pose X_VW = camera_at(data, image.exposed_at).inverse();
    for (TagSighting& seen : image.tags) {
      const RecordedTag* tag = data.tag(seen.tag_id);
      if (tag == nullptr) continue;
      const auto corners = simulation::corners_of(*tag);
      for (std::size_t i = 0; i < corners.size(); ++i) {
        if (!random.chance(share)) continue;
        const double du = random.normal();
        const double dv = random.normal();
        const auto px = data.camera.model.project(X_VW * corners[i]);
        if (px) seen.corners_px[i] = *px + sigma_px * Eigen::Vector2d(du, dv);
      }
    }
  });
}

void mirror_images(EstimationData& data) {
  const double last_px = data.camera.model.width - 1;
  for_each_image(data, [&](CornerFrame& image) {
    for (TagSighting& tag : image.tags) {
      for (Eigen::Vector2d& px : tag.corners_px) px.x() = last_px - px.x();
      std::swap(tag.corners_px[0], tag.corners_px[1]);
      std::swap(tag.corners_px[2], tag.corners_px[3]);
    }
  });
}

void show_moved_tag_alone(EstimationData& data, const Eigen::Vector3d& by_m, std::uint64_t seed) {
  const double window_s = std::min(5.0, length_s(data) / 5);
  const MovedAlone alone = most_seen_alone(data, by_m, window_s, seed);
  if (alone.tag_id < 0) return;
  Pose moved = data.tag(alone.tag_id)->X_WT;
  moved.p += by_m;
  carry(
      data, alone.tag_id, alone.from_s, [&](double) { return moved; }, seed + kAlone);
  for_images(data, [&](CornerFrame& image, std::size_t, double t_s) {
    const double since_s = t_s - alone.from_s;
    if (since_s < 0 || since_s >= 2 * window_s) return;
    std::erase_if(image.tags, [&](const TagSighting& tag) {
      return since_s < window_s || tag.tag_id != alone.tag_id;
    });
  });
}

TagMap kept_map(const EstimationData& data, std::uint64_t seed) {
  Random random(seed, Purpose::kRoom, kMap);
  const Pose X_WR = workspace_of(data);
  TagMap map;
  map.family = data.tag_set.family;
  map.reference_tag = data.reference_tag;
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal().head<3>().setConstant(kKept_m * kKept_m);
  covariance.diagonal().tail<3>().setConstant(kKept_rad * kKept_rad);
  for (const RecordedTag& tag : data.tags) {
    Pose X_WT = X_WR * tag.X_WT;
    const Eigen::Vector3d off_m = kKept_m * random.normal3();
    const Eigen::Vector3d off_rad = kKept_rad * random.normal3();
    if (tag.tag_id != data.reference_tag) X_WT = {exp_so3(off_rad) * X_WT.q, X_WT.p + off_m};
    map.insert({.tag = {tag.tag_id, tag.edge_m, X_WT, covariance}, .state = TagState::kCalibrated});
  }
  return map;
}

TagMap map_before_moves(const EstimationData& data, std::uint64_t seed) {
  TagMap map = kept_map(data, seed);
  Random random(seed, Purpose::kRoom, kMap, 1);
  for (MapTag& entry : map.tags) {
    if (entry.tag.tag_id != data.reference_tag)
      entry.tag.X_WT = displaced(entry.tag.X_WT, kMovedOvernight_m, kTurnedOvernight_rad, random);
  }
  return map;
}

TagMap map_of_another_room(const EstimationData& data, std::uint64_t seed) {
  TagMap map = kept_map(data, seed);
  std::vector<MapTag*> others;
  for (MapTag& entry : map.tags)
    if (entry.tag.tag_id != data.reference_tag) others.push_back(&entry);
  for (std::size_t i = 1; i < others.size(); ++i)
    std::swap(others[i - 1]->tag.X_WT, others[i]->tag.X_WT);
  return map;
}

}  // namespace fiducap::mismatch
