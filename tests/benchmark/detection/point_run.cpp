#include <cmath>
#include <map>

#include "base/process.hpp"
#include "detection/runs.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::bench {

namespace {

/// Intersection of a ray from inside a room with its walls.
Eigen::Vector3d on_wall(const simulation::RoomBox& box, const Eigen::Vector3d& from,
                        const Eigen::Vector3d& ray) {
  double along = 1e9;
  for (int axis = 0; axis < 3; ++axis) {
    const double wall = ray(axis) > 0 ? box.high(axis) : box.low(axis);
    if (ray(axis) != 0) along = std::min(along, (wall - from(axis)) / ray(axis));
  }
  return from + along * ray;
}

std::vector<TagSighting> sighted(const std::vector<RecordedTag>& tags, const CameraModel& model,
                                 const Pose& X_WV) {
  std::vector<TagSighting> out;
  for (const RecordedTag& tag : tags) {
    const Eigen::Vector3d normal = tag.X_WT.q * Eigen::Vector3d::UnitZ();
    if (normal.dot(X_WV.p - tag.X_WT.p) < 0) continue;
    TagSighting sighting;
    const auto corners = simulation::corners_of(tag);
    bool seen = true;
    for (std::size_t i = 0; i < 4 && seen; ++i) {
      const auto px = model.project(X_WV.inverse() * corners[i]);
      constexpr double kBeside_px = 100;
      seen = px && px->x() > -kBeside_px && px->y() > -kBeside_px &&
             px->x() < model.width + kBeside_px && px->y() < model.height + kBeside_px;
      if (seen) sighting.corners_px[i] = *px;
    }
    if (seen) out.push_back(sighting);
  }
  return out;
}

/// The place on the wall that a track showed first, and its error at the last report.
struct Anchor {
  Eigen::Vector3d p_W;
  Eigen::Vector2d error_px{Eigen::Vector2d::Zero()};
  bool bad{false};
};

/// Compares every report of a point with the true image of the place that it showed first.
class AnchorCheck {
 public:
  AnchorCheck(const simulation::RoomConfig& room, const CameraModel& model)
      : box_(simulation::box_of(room)), model_(model) {}

  void take(const PointSighting& point, const Pose& X_WV, PointRun& run) {
    if (point.age == 0) {
      const Eigen::Vector2d ideal = undistort(model_, point.px)->px;
      const Eigen::Vector3d ray((ideal.x() - model_.cu) / model_.fu,
                                (ideal.y() - model_.cv) / model_.fv, 1);
      anchors_[point.track] = {on_wall(box_, X_WV.p, X_WV.q * ray)};
      return;
    }
    Anchor& anchor = anchors_.at(point.track);
    if (anchor.bad || point.age >= PointRun::kAges) return;
    PointRun::AtAge& age = run.ages[static_cast<std::size_t>(point.age)];
    const Eigen::Vector2d truth =
        model_.project(X_WV.inverse() * anchor.p_W).value_or(Eigen::Vector2d(-1e3, -1e3));
    const Eigen::Vector2d error = point.px - truth;
    if (!(error.cwiseAbs().maxCoeff() < PointRun::kGross_px)) {
      anchor.bad = true;
      ++age.gross;
      return;
    }
    age.squares_px2 += error.squaredNorm();
    age.products_px2 += error.dot(anchor.error_px);
    age.coordinates += 2;
    anchor.error_px = error;
  }

 private:
  simulation::RoomBox box_;
  const CameraModel& model_;
  std::map<std::uint32_t, Anchor> anchors_;
};

}  // namespace

PointRun run_points(const PointRunSetup& setup) {
  simulation::RoomConfig room;
  room.preset = setup.room;
  room.texture = setup.texture;
  const CameraMount mount = barrel_camera(setup.width, setup.height);
  simulation::SimulatedBodyConfig body;
  body.cameras = {mount};
  body.has_imu = false;
  body.trajectory.kind = setup.room == "hall" ? "survey" : setup.room;
  body.trajectory.duration_s = setup.images / mount.rate_hz;
  body.trajectory.seed = body.seed = setup.seed;
  const auto source = simulation::make_simulated_source(room, body, instant_from_ns(0), nullptr);
  PointRun run;
  if (!source) return run;
  const auto tags = simulation::tags_of(room);
  AnchorCheck check(room, mount.model);
  PointTracker tracker;
  std::optional<Eigen::Quaterniond> q_before;
  int reports = 0;
  for (;;) {
    const auto sample = (*source)->next({});
    if (!sample || !*sample) break;
    const auto& frame = std::get<CameraFrame>(**sample);
    const Pose X_WV = (*source)->truth(frame.exposed_at).X_WB * mount.X_BV;
    const auto seen = sighted(tags, mount.model, X_WV);
    std::optional<Eigen::Quaterniond> turn;
    if (q_before) turn = q_before->conjugate() * X_WV.q;
    q_before = X_WV.q;
    const Duration begin = thread_cpu_time();
    const auto points = tracker.follow(frame, mount.model, turn, seen);
    run.cpu_ms.push_back(1e3 * to_seconds(thread_cpu_time() - begin));
    if (points.empty()) continue;
    ++reports;
    run.points += static_cast<double>(points.size());
    for (const PointSighting& point : points) check.take(point, X_WV, run);
  }
  run.points /= std::max(1, reports);
  run.statistics = tracker.statistics();
  return run;
}

}  // namespace fiducap::bench
