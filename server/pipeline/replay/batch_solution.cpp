#include "pipeline/replay/batch_solution.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "estimation/segment/segment_cutting.hpp"
#include "estimation/segment/segment_recorder.hpp"
#include "pipeline/replay/image_placement.hpp"

namespace fiducap {
namespace {

constexpr int kMostPlacements = 6;  // three without odometry, until its noise is known with it
// Odometry may be worse than specified; at first its noise is inflated by this, and images decide.
constexpr double kDoubtOfOdometry = 30;
// Its noise has converged when it changes by no more than this factor.
constexpr double kSameNoise = 1.2;
constexpr double kReportedNoise = 3;

/// Places the images of bodies without IMU and solves for everything, alternately.
class Placing final {
 public:
  Placing(BodiesReplay& replay, std::span<const BatchBody> bodies) : replay_(replay) {
    for (std::size_t i = 0; i < bodies.size(); ++i)
      if (!bodies[i].setup->sensors.imu) bodies_.push_back({bodies[i], i});
    for (Body& one : bodies_) {
      if (one.body.odometry == nullptr) continue;
      if (std::ranges::none_of(*one.body.log, [&](const LoggedInstant& instant) {
            return one.body.odometry->covers(instant.at);
          })) {
        one.body.odometry = nullptr;
        one.is_of_other_times = true;
        continue;
      }
      one.odometry = *one.body.odometry;
      one.odometry->move_noise_m *= kDoubtOfOdometry;
      one.odometry->turn_noise_rad *= kDoubtOfOdometry;
    }
    asks_filters_ = bodies_.size() < bodies.size() ||
                    std::ranges::any_of(bodies_, [](const Body& one) { return !one.odometry; });
  }
  [[nodiscard]] bool is_empty() const { return bodies_.empty(); }

  BatchResult run(const std::function<void(int round)>& progress) {
    ImagePlacement placement(to_place(), bodies_.front().body.setup->estimator.branch_evidence);
    begin(placement);
    result_.last.is_at_rest = true;  // while there is nothing to solve for
    bool has_moved = placement.settle();
    placement.define_workspace(bodies_.front().body.setup->gauge);
    for (; has_moved && result_.rounds < kMostPlacements; ++result_.rounds) {
      for (std::size_t i = 0; i < bodies_.size(); ++i)
        replay_.refiner().replace_body(bodies_[i].body.id, segments_of(i, placement));
      const auto last = replay_.solve_to_rest(progress);
      result_.last.is_at_rest = last.is_at_rest;
      result_.last.has_found_workspace |= last.has_found_workspace;
      const bool has_other_weights = learn(placement);
      // The first round changes all weights by the estimated noise.
      has_moved = placement.settle() || result_.rounds == 0 || has_other_weights;
    }
    result_.is_by_odometry = !asks_filters_;
    for (const Body& one : bodies_)
      if (auto text = doubt_of(one)) result_.doubts.emplace(one.body.id, std::move(*text));
    return result_;
  }

 private:
  struct Body {
    BatchBody body;
    std::size_t index{};                 ///< In the replay.
    std::optional<double> noise_px{};    ///< By the last solution.
    std::optional<Odometry> odometry{};  ///< With its estimated noise.
    bool is_learned{};                   ///< The noise is by a solution.
    bool is_of_other_times{};            ///< The odometry covers none of the images.
  };

  [[nodiscard]] const BodyFilter& filter(const Body& one) const {
    return replay_.pipeline(one.index).filter();
  }

  [[nodiscard]] std::vector<BodyToPlace> to_place() const {
    std::vector<BodyToPlace> out;
    for (const Body& one : bodies_) {
      auto cameras = one.body.setup->sensors.cameras;
      const auto beliefs = camera_beliefs(filter(one), cameras);
      for (std::size_t c = 0; c < cameras.size(); ++c) cameras[c].X_BV = beliefs[c].X_BV;
      out.push_back({one.body.log, std::move(cameras), one.body.odometry,
                     one.body.setup->estimator.corner_noise_px});
    }
    return out;
  }

  /// With the tags of map and graph.
  void begin(ImagePlacement& placement) const {
    for (const GraphTag& tag : replay_.graph().state().tags)
      if (tag.component == kInWorkspace && (asks_filters_ || tag.sightings_before > 0))
        placement.put({tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()}, false);
    for (const MapTag& entry : replay_.map().snapshot()->tags) {
      if (entry.state == TagState::kQuarantined || entry.component != kInWorkspace) continue;
      const bool is_held = entry.state == TagState::kSurveyed;
      if (is_held || asks_filters_) placement.put(entry.tag, is_held);
    }
    for (const Body& one : bodies_)
      for (const KnownTag& tag : one.body.setup->priors) placement.survey(tag);
  }

  std::vector<MotionSegment> segments_of(std::size_t i, const ImagePlacement& placement) const {
    const Body& one = bodies_[i];
    const PipelineSetup& setup = *one.body.setup;
    PlacedPath path;
    path.head.body_id = one.body.id;
    path.head.sensors = std::make_shared<const SegmentSensors>(
        SegmentSensors{setup.sensors.cameras, false, setup.sensors.gravity_m_s2,
                       setup.estimator.estimate_extrinsics, setup.estimator.estimate_clocks});
    path.motion = motion_without_imu(setup.estimator);
    if (one.odometry) path.odometry = &*one.odometry;
    path.head.cameras = camera_beliefs(filter(one), setup.sensors.cameras);
    for (const GraphBody& body : replay_.graph().state().bodies)
      if (body.id == one.body.id) path.head.cameras = body.cameras;
    std::vector<MotionSegment> all;
    for (int region = 0; region < placement.regions(); ++region) {
      path.head.anchored = region == 0;
      path.head.chain = all.empty() ? 0 : all.back().chain + 1;
      path.tags.clear();
      for (const auto& [tag_id, tag] : placement.tags())
        if (tag.region == region) path.tags.emplace(tag_id, tag.tag);
      path.instants.clear();
      const auto& placed = placement.placed(i);
      for (std::size_t k = 0; k < placed.size(); ++k) {
        if (placed[k].region != region) continue;
        path.instants.push_back({placed[k].at, placed[k].X_WB, {}});
        for (const TagObservations& image : (*one.body.log)[k].images)
          path.instants.back().images.push_back(noted(i, image));
      }
      auto segments = cut_segments(path);
      std::move(segments.begin(), segments.end(), std::back_inserter(all));
    }
    return all;
  }

  /// With the noise of the last solution, where the detector gives none.
  [[nodiscard]] SegmentImage noted(std::size_t i, const TagObservations& seen) const {
    const Body& one = bodies_[i];
    SegmentImage image = segment_image(seen, filter(one), one.body.setup->estimator);
    for (SegmentSighting& sighting : image.tags)
      if (one.noise_px && sighting.is_even && sighting.seen.corner_sigma_px == 0)
        sighting.noise_px = *one.noise_px;
    return image;
  }

  /// @return whether the noise of the odometry has changed
  bool learn(ImagePlacement& placement) {
    bool is_otherwise = false;
    const GraphState& graph = replay_.graph().state();
    for (const GraphTag& tag : graph.tags)
      if (tag.component == kInWorkspace)
        placement.take(KnownTag{tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()});
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const auto path = path_of(bodies_[i].body.id, graph, nullptr);
      if (!path) continue;
      std::vector<StampedPose> poses;
      for (const PathPose& pose : *path) poses.push_back({pose.at, pose.X_WB});
      for (const GraphBody& body : graph.bodies)
        if (body.id == bodies_[i].body.id) placement.take(i, body.cameras, poses);
      // With odometry only once, while its weight is low: its errors would be taken for corner
      // noise.
      Body& one = bodies_[i];
      if (!one.odometry || !one.noise_px) one.noise_px = placement.learn_noise(i);
      if (one.odometry) is_otherwise |= learn_odometry(poses, one);
    }
    return is_otherwise;
  }

  /// Mean squares of the difference between solution and odometry, per number and second.
  struct Drift {
    double turn{};
    double move{};
  };
  /// @param lag  least span
  static Drift drift_of(const Odometry& odometry, std::span<const StampedPose> poses,
                        Duration lag) {
    const Duration longest = lag + std::chrono::seconds(2);
    Drift sum;
    int steps = 0;
    std::size_t to = 1;
    for (std::size_t from = 0; from + 1 < poses.size(); ++from) {
      to = std::max(to, from + 1);
      while (to < poses.size() && poses[to].at - poses[from].at < lag) ++to;
      if (to == poses.size()) break;
      const Duration time = poses[to].at - poses[from].at;
      const auto expected = odometry.motion(poses[from].at, poses[to].at);
      if (!expected || time <= Duration{0} || time > longest) continue;
      const Pose off = expected->inverse() * (poses[from].X_WB.inverse() * poses[to].X_WB);
      sum.turn += log_so3(off.q).squaredNorm() / (3 * to_seconds(time));
      sum.move += off.p.squaredNorm() / (3 * to_seconds(time));
      ++steps;
    }
    if (steps > 0) sum = {sum.turn / steps, sum.move / steps};
    return sum;
  }

  /// Never less than specified, since unobserved motion follows the odometry. Correlated errors
  /// show over long spans, and hardly from image to image.
  static bool learn_odometry(std::span<const StampedPose> poses, Body& one) {
    Drift most;
    for (const double lag_s : {0.0, 1.0, 5.0}) {
      const Drift drift = drift_of(*one.odometry, poses, from_seconds(lag_s));
      most = {std::max(most.turn, drift.turn), std::max(most.move, drift.move)};
    }
    one.is_learned = true;
    const Odometry before = *one.odometry;
    one.odometry->turn_noise_rad =
        std::max(one.body.odometry->turn_noise_rad, std::sqrt(most.turn));
    one.odometry->move_noise_m = std::max(one.body.odometry->move_noise_m, std::sqrt(most.move));
    const auto differs = [](double x, double y) { return std::max(x / y, y / x) > kSameNoise; };
    return differs(before.turn_noise_rad, one.odometry->turn_noise_rad) ||
           differs(before.move_noise_m, one.odometry->move_noise_m);
  }

  /// The camera's pose by odometry contradicts its configuration: one of both is wrong.
  [[nodiscard]] std::optional<std::string> camera_doubt(const Body& one) const {
    constexpr double kConfigured_sigma = 4.0;
    constexpr double kLeast = 0.01;  // m and rad: less is never reported
    for (const GraphBody& body : replay_.graph().state().bodies) {
      if (body.id != one.body.id) continue;
      for (std::size_t k = 0; k < body.cameras.size(); ++k) {
        const CameraMount& mount = one.body.setup->sensors.cameras[k];
        const double turned = angle_between(mount.X_BV.q, body.cameras[k].X_BV.q);
        const double moved = (mount.X_BV.p - body.cameras[k].X_BV.p).norm();
        if (turned > std::max(kLeast, kConfigured_sigma * mount.rotation_sigma_rad) ||
            moved > std::max(kLeast, kConfigured_sigma * mount.position_sigma_m))
          return fmt::format(
              "by the odometry camera {} is {:.0f} mm and {:.1f}° from its configured pose; one of "
              "both is wrong. Check T_BS of the odometry and of the camera: attitudes of the body "
              "may be wrong by as much",
              k, 1e3 * moved, turned * kDegreesPerRadian);
      }
    }
    return std::nullopt;
  }

  [[nodiscard]] std::optional<std::string> doubt_of(const Body& one) const {
    if (one.is_of_other_times)
      return "the odometry covers none of the images with tags and is not used: are its stamps of "
             "another clock, or in other units?";
    if (!one.odometry || !one.is_learned) return std::nullopt;
    if (auto doubt = camera_doubt(one)) return doubt;
    const Odometry& given = *one.body.odometry;
    if (one.odometry->move_noise_m < kReportedNoise * given.move_noise_m &&
        one.odometry->turn_noise_rad < kReportedNoise * given.turn_noise_rad)
      return std::nullopt;
    return fmt::format(
        "the odometry differs from the motion by the tags, by {:.2g} mm and {:.2g} mrad after a "
        "second instead of the specified {:.2g} and {:.2g}; its weight is reduced accordingly. "
        "Check its stamps, its pose on the body (T_BS) and the direction of its axes",
        1e3 * one.odometry->move_noise_m, 1e3 * one.odometry->turn_noise_rad,
        1e3 * given.move_noise_m, 1e3 * given.turn_noise_rad);
  }

  BodiesReplay& replay_;
  std::vector<Body> bodies_;
  /// False if all bodies have odometry, which is better than filters without it.
  bool asks_filters_{};
  BatchResult result_;
};

}  // namespace

BatchResult solve_all(BodiesReplay& replay, std::span<const BatchBody> bodies,
                      const std::function<void(int round)>& progress) {
  BatchResult result;
  Placing placing(replay, bodies);
  const bool has_imu = std::ranges::any_of(
      bodies, [](const BatchBody& body) { return body.setup->sensors.imu.has_value(); });
  if (has_imu) result.last = replay.refine_to_the_end(progress);
  if (!placing.is_empty()) {
    const bool has_found = result.last.has_found_workspace;
    result = placing.run(progress);
    result.last.has_found_workspace |= has_found;
  }
  return result;
}

}  // namespace fiducap
