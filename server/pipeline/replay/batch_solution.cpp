#include "pipeline/replay/batch_solution.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "base/so3.hpp"
#include "estimation/segment/segment_cutting.hpp"
#include "estimation/segment/segment_recorder.hpp"
#include "pipeline/replay/image_placement.hpp"

namespace fiducap {
namespace {

constexpr int kMostPlacements = 4;
constexpr int kMostWithOdometry = 6;  // until its noise is known
// Odometry may be worse than it says; at first it is taken for so much worse, and images decide.
constexpr double kDoubtOfOdometry = 30;
// Its noise is known well enough when it changes by no more than this.
constexpr double kSameNoise = 1.2;
constexpr double kWorthTelling = 5;

/// Bodies without IMU.
class Placing final {
 public:
  Placing(BodiesReplay& replay, std::span<const BatchBody> bodies) : replay_(replay) {
    for (std::size_t i = 0; i < bodies.size(); ++i)
      if (!bodies[i].setup->sensors.imu) bodies_.push_back({bodies[i], i, {}, {}});
    asks_filters_ = std::any_of(bodies.begin(), bodies.end(), [](const BatchBody& body) {
      return body.setup->sensors.imu || body.odometry == nullptr;
    });
    for (Body& one : bodies_) {
      if (one.body.odometry == nullptr) continue;
      one.odometry = *one.body.odometry;
      one.odometry->move_noise_m *= kDoubtOfOdometry;
      one.odometry->turn_noise_rad *= kDoubtOfOdometry;
    }
  }
  [[nodiscard]] bool is_empty() const { return bodies_.empty(); }

  BatchResult run(const std::function<void(int round)>& progress) {
    ImagePlacement placement(to_place());
    begin(placement);
    BatchResult result;
    result.last.is_at_rest = true;  // while there is nothing to solve for
    const bool has_odometry = std::any_of(bodies_.begin(), bodies_.end(),
                                          [](const Body& one) { return one.odometry.has_value(); });
    const int most = has_odometry ? kMostWithOdometry : kMostPlacements;
    bool goes_on = placement.settle();
    placement.define_workspace(bodies_.front().body.setup->gauge);
    for (; goes_on && result.rounds < most; ++result.rounds) {
      for (std::size_t i = 0; i < bodies_.size(); ++i)
        replay_.refiner().replace_body(bodies_[i].body.id, segments_of(i, placement));
      const auto last = replay_.solve_to_rest(progress);
      result.last.is_at_rest = last.is_at_rest;
      result.last.has_found_workspace |= last.has_found_workspace;
      const bool weighs_otherwise = learn(placement);
      // With the noise that was found all of it weighs otherwise: once more in any case.
      goes_on = placement.settle() || result.rounds == 0 || weighs_otherwise;
    }
    for (const Body& one : bodies_)
      if (auto text = doubt_of(one)) result.doubts.emplace(one.body.id, std::move(*text));
    return result;
  }

 private:
  struct Body {
    BatchBody body;
    std::size_t index{};               ///< In the replay.
    std::optional<double> noise_px{};  ///< By the last solution.
    std::optional<Odometry> odometry;  ///< As noisy as it seems to be.
  };

  [[nodiscard]] const BodyFilter& filter(const Body& one) const {
    return replay_.pipeline(one.index).filter();
  }

  [[nodiscard]] std::vector<BodyToPlace> to_place() const {
    std::vector<BodyToPlace> out;
    for (const Body& one : bodies_) {
      const auto& cameras = one.body.setup->sensors.cameras;
      out.push_back({one.body.log, cameras, camera_beliefs(filter(one), cameras), one.body.odometry,
                     one.body.setup->estimator.corner_noise_px});
    }
    return out;
  }

  /// Where map, graph and filters have the tags.
  void begin(ImagePlacement& placement) const {
    const auto map = replay_.map().snapshot();
    for (const MapTag& entry : map->tags) {
      if (entry.state == TagState::kQuarantined || entry.component != 0) continue;
      if (entry.state == TagState::kSurveyed)
        placement.hold(entry.tag);
      else if (asks_filters_)
        placement.suggest(0, entry.tag);
    }
    for (const Body& one : bodies_)
      for (const KnownTag& tag : one.body.setup->priors) placement.survey(tag);
    if (!asks_filters_) return;
    int component = 0;  // of the last one that was suggested
    for (const GraphTag& tag : replay_.graph().state().tags) {
      if (tag.sightings == tag.sightings_before) continue;
      placement.suggest(tag.component, {tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()});
      component = std::max(component, tag.component);
    }
    for (const Body& one : bodies_) {
      if (one.odometry) continue;
      std::vector<TagBelief> beliefs;
      filter(one).own_tags(beliefs);
      int most = component;
      for (const TagBelief& belief : beliefs) {
        const bool is_in_workspace = belief.component == TagBelief::kWorkspace;
        const int own = is_in_workspace ? 0 : component + 1 + belief.component;
        if (!is_in_workspace || map->find(belief.tag.tag_id) == nullptr)
          placement.suggest(own, belief.tag);
        most = std::max(most, own);
      }
      component = most;
    }
  }

  std::vector<MotionSegment> segments_of(std::size_t i, const ImagePlacement& placement) const {
    const Body& one = bodies_[i];
    const PipelineSetup& setup = *one.body.setup;
    PlacedPath path;
    path.body_id = one.body.id;
    path.sensors = std::make_shared<const SegmentSensors>(
        SegmentSensors{setup.sensors.cameras, false, setup.sensors.gravity_m_s2,
                       setup.estimator.estimate_extrinsics, setup.estimator.estimate_clocks});
    path.motion = motion_without_imu(setup.estimator);
    if (one.odometry) path.odometry = &*one.odometry;
    path.cameras = placement.cameras(i);
    std::vector<MotionSegment> all;
    for (int region = 0; region < placement.regions(); ++region) {
      path.anchored = region == 0;
      path.chain = all.empty() ? 0 : all.back().chain + 1;
      path.tags.clear();
      for (const auto& [tag_id, tag] : placement.tags())
        if (tag.region == region) path.tags.emplace(tag_id, tag.tag);
      path.instants.clear();
      const auto& placed = placement.placed(i);
      for (std::size_t k = 0; k < placed.size(); ++k) {
        if (placed[k].region != region) continue;
        path.instants.push_back({placed[k].at, placed[k].X_WB, {}});
        for (const TagObservations& image : one.body.log->instants()[k].images)
          path.instants.back().images.push_back(noted(i, image));
      }
      auto segments = cut_segments(path);
      std::move(segments.begin(), segments.end(), std::back_inserter(all));
    }
    return all;
  }

  /// With the noise that the last solution left, where the detector does not tell its own.
  [[nodiscard]] SegmentImage noted(std::size_t i, const TagObservations& seen) const {
    const Body& one = bodies_[i];
    SegmentImage image = segment_image(seen, filter(one), one.body.setup->estimator);
    for (SegmentSighting& sighting : image.tags)
      if (one.noise_px && sighting.is_even && sighting.seen.corner_sigma_px == 0)
        sighting.noise_px = *one.noise_px;
    return image;
  }

  /// @return whether odometry is noisier or better than was thought
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
      bodies_[i].noise_px = placement.learn_noise(i);
      if (bodies_[i].odometry) is_otherwise |= learn_odometry(poses, bodies_[i]);
    }
    return is_otherwise;
  }

  /// From how the solution moved otherwise than it. It is never better than it says: what images
  /// say nothing of follows it.
  static bool learn_odometry(std::span<const StampedPose> poses, Body& one) {
    constexpr Duration kBlind = std::chrono::seconds(2);
    double turned = 0;
    double moved = 0;
    int steps = 0;
    for (std::size_t k = 1; k < poses.size(); ++k) {
      const StampedPose& a = poses[k - 1];
      const StampedPose& b = poses[k];
      const auto expected = one.odometry->motion(a.at, b.at);
      if (!expected || b.at <= a.at || b.at - a.at > kBlind) continue;
      const Pose off = expected->inverse() * (a.X_WB.inverse() * b.X_WB);
      const double numbers = 3 * to_seconds(b.at - a.at);
      turned += log_so3(off.q).squaredNorm() / numbers;
      moved += off.p.squaredNorm() / numbers;
      ++steps;
    }
    if (steps == 0) return false;
    const Odometry before = *one.odometry;
    one.odometry->turn_noise_rad =
        std::max(one.body.odometry->turn_noise_rad, std::sqrt(turned / steps));
    one.odometry->move_noise_m =
        std::max(one.body.odometry->move_noise_m, std::sqrt(moved / steps));
    const auto differs = [](double x, double y) { return std::max(x / y, y / x) > kSameNoise; };
    return differs(before.turn_noise_rad, one.odometry->turn_noise_rad) ||
           differs(before.move_noise_m, one.odometry->move_noise_m);
  }

  static std::optional<std::string> doubt_of(const Body& one) {
    if (!one.odometry) return std::nullopt;
    const Odometry& told = *one.body.odometry;
    if (one.odometry->move_noise_m < kWorthTelling * told.move_noise_m &&
        one.odometry->turn_noise_rad < kWorthTelling * told.turn_noise_rad)
      return std::nullopt;
    return fmt::format(
        "the odometry moves otherwise than the tags say, by {:.0f} mm and {:.0f} mrad after a "
        "second, not {:.0f} and {:.0f} as it is told; it is taken for as noisy as that. Look at "
        "its stamps, where it sits on the body (T_BS) and which way its axes point",
        1e3 * one.odometry->move_noise_m, 1e3 * one.odometry->turn_noise_rad,
        1e3 * told.move_noise_m, 1e3 * told.turn_noise_rad);
  }

  BodiesReplay& replay_;
  std::vector<Body> bodies_;
  /// Filters do not know of odometry: where all bodies have it, it says more than they do.
  bool asks_filters_{};
};

}  // namespace

BatchResult solve_all(BodiesReplay& replay, std::span<const BatchBody> bodies,
                      const std::function<void(int round)>& progress) {
  BatchResult result;
  Placing placing(replay, bodies);
  const bool has_imu = std::any_of(bodies.begin(), bodies.end(), [](const BatchBody& body) {
    return body.setup->sensors.imu.has_value();
  });
  if (has_imu) result.last = replay.refine_to_the_end(progress);
  if (!placing.is_empty()) {
    const bool has_found = result.last.has_found_workspace;
    result = placing.run(progress);
    result.last.has_found_workspace |= has_found;
  }
  return result;
}

}  // namespace fiducap
