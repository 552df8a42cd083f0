#include <algorithm>
#include <cmath>
#include <optional>

#include "simulation/motion/motion.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

namespace {

/// Progress along a path: rest, then a ramp to full speed, four times continuously differentiable.
/// On an open path it goes back and forth.
class TimeWarp final {
 public:
  struct Point {
    double s;       ///< Path parameter, seconds at full speed.
    double first;   ///< ds/dt
    double second;  ///< d²s/dt²
  };

  /// @param length  of the path, > 0; nullopt: closed
  explicit TimeWarp(std::optional<double> length)
      : length_(length), ramp_(length ? std::min(kRamp_s, *length) : kRamp_s) {}

  /// @param t  seconds since the start; at rest before 0
  [[nodiscard]] Point at(double t) const {
    const double moving = std::max(0.0, t - kRest_s);
    if (!length_) return leg(moving);
    const double there = *length_ + ramp_;  // time of one way
    const double phase = std::fmod(moving, 2 * there);
    if (phase <= there) return leg(phase);
    const Point back = leg(2 * there - phase);
    return {back.s, -back.first, back.second};
  }

 private:
  static constexpr double kRest_s = 1.0;
  static constexpr double kRamp_s = 2.0;

  /// From rest to speed 1 within x = 0..1, over a distance of 1/2; the first three derivatives of
  /// the speed vanish at both ends.
  [[nodiscard]] static Point ramp_up(double x) {
    const double x3 = x * x * x;
    const double x4 = x3 * x;
    return {x4 * x * (7 + x * (-14 + x * (10 - 2.5 * x))),
            x4 * (35 + x * (-84 + x * (70 - 20 * x))), 140 * x3 * std::pow(1 - x, 3)};
  }
  [[nodiscard]] Point leg(double t) const {
    if (t < ramp_) {
      const Point up = ramp_up(t / ramp_);
      return {ramp_ * up.s, up.first, up.second / ramp_};
    }
    if (!length_ || t <= *length_) return {t - 0.5 * ramp_, 1.0, 0.0};
    const Point down = ramp_up((*length_ + ramp_ - t) / ramp_);
    return {*length_ - ramp_ * down.s, down.first, -down.second / ramp_};
  }

  std::optional<double> length_;
  double ramp_;
};

/// Follows a spline of body poses from rest.
class SplineTrajectory final : public Trajectory {
 public:
  SplineTrajectory(PoseSpline spline, double speed)
      : spline_(std::move(spline)),
        warp_(spline_.closed() ? std::nullopt : std::optional(spline_.length())),
        speed_(speed) {}

  [[nodiscard]] Point at(double t_s) const override {
    const TimeWarp::Point along = warp_.at(t_s * speed_);
    const double first = along.first * speed_;
    const double second = along.second * speed_ * speed_;
    const PoseSpline::Point p = spline_.at(along.s);
    return {p.X, p.velocity * first, p.acceleration * (first * first) + p.velocity * second,
            p.rate * first};
  }

 private:
  PoseSpline spline_;
  TimeWarp warp_;
  double speed_;
};

/// Scales the time of the motion so that it just reaches the first of its limits.
void scale_to_limits(PoseSpline& spline, const MotionPlan& plan, const Pose& X_BV) {
  if (plan.speed_m_s <= 0) return;
  double share = 0;
  const double step = 0.2 * spline.spacing();
  for (double s = 0; s < spline.length(); s += step) {
    const PoseSpline::Point p = spline.at(s);
    const Eigen::Vector3d camera_velocity = p.velocity + p.X.q * p.rate.cross(X_BV.p);
    share =
        std::max({share, camera_velocity.norm() / plan.speed_m_s, p.rate.norm() / plan.rate_rad_s,
                  std::sqrt(p.acceleration.norm() / plan.acceleration_m_s2)});
  }
  if (share > 0) spline.set_spacing(spline.spacing() * share);
}

}  // namespace

Pose forward_camera() {
  // Columns: camera x (right), y (down), z (ahead) in body axes x ahead, y left, z up.
  Eigen::Matrix3d R_BV;
  R_BV << 0, 0, 1,  //
      -1, 0, 0,     //
      0, -1, 0;
  return {Eigen::Quaterniond(R_BV), Eigen::Vector3d::Zero()};
}

Expected<std::unique_ptr<Trajectory>> make_trajectory(const TrajectoryConfig& config,
                                                      const RoomConfig& room, const Pose& X_BV) {
  if (config.kind == "file") {
    auto poses = read_pose_file(config.file);
    if (!poses) return tl::unexpected(poses.error());
    return std::make_unique<SplineTrajectory>(fit_spline(*poses), config.speed);
  }
  if (tags_of(room).empty())
    return fail(ErrorCode::kInvalid, "expected a room with at least one tag", "trajectory");
  const auto plan = plan_motion(config, room);
  if (!plan)
    return fail(ErrorCode::kUnsupported, "no such kind of trajectory: " + config.kind,
                "trajectory");
  const Pose X_VB = X_BV.inverse();
  std::vector<Pose> X_WB;
  for (const Pose& X_WV : plan->X_WV) X_WB.push_back(X_WV * X_VB);
  PoseSpline spline(X_WB, plan->spacing_s, true);
  scale_to_limits(spline, *plan, X_BV);
  return std::make_unique<SplineTrajectory>(std::move(spline), config.speed);
}

}  // namespace fiducap::simulation
