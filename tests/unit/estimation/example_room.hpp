#pragma once

#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "estimation/body_filter.hpp"
#include "example_tags.hpp"

namespace fiducap {

/// A wall of tags before which a body moves to and fro, with noisy readings and corners: the
/// smallest simulation for a filter and a map that exchange data. Room axes are level, z up; the
/// truth is known.
class ExampleRoom {
 public:
  struct Setup {
    std::string filter{"world"};
    WorkspaceGauge gauge{};
    EstimatorConfig estimator{};
    double image_period_s{0.05};
    double imu_period_s{0.005};
    double pixel_sigma{0.3};
    std::uint64_t seed{1};
    /// How the body moves; nullptr: about its place, at some 0.3 m/s.
    std::function<Pose(double t_s)> path{};
    double shift_sigma_s{0.02};
    bool has_imu{true};
  };

  explicit ExampleRoom(Setup setup) : setup_(std::move(setup)), random_(setup_.seed) {
    CameraMount mount;
    mount.model = example_camera();
    mount.X_BV = {exp_so3({-kQuarterTurn, 0, 0}), {0.05, 0.02, -0.03}};
    mount.time_shift_sigma_s = setup_.shift_sigma_s;
    sensors_.cameras = {mount};
    sensors_.imu = ImuNoise{};
    sensors_.imu->rate_hz = 1.0 / setup_.imu_period_s;
    imu_on = setup_.has_imu;
    if (!setup_.has_imu) sensors_.imu.reset();
    for (int i = 0; i < 6; ++i) {
      const Pose X_RT{exp_so3({0, 0, 0.35 * std::pow(-1.0, i)}) *
                          exp_so3({kQuarterTurn + 0.3 * std::pow(-1.0, i / 2), 0, 0}),
                      {-1.0 + 0.4 * i, 2.0, 1.1 + 0.25 * (i % 3)}};
      tags[i] = X_RT;
    }
    reset_filter();
  }

  void reset_filter() {
    filter = make_body_filter(setup_.filter, sensors_, setup_.gauge, setup_.estimator);
  }

  static Pose usual_path(double t) {
    return {
        exp_so3(
            {0.12 * std::sin(1.3 * t), 0.1 * std::sin(0.9 * t + 0.4), 0.15 * std::sin(0.8 * t)}),
        {0.35 * std::sin(1.1 * t), 0.25 * std::sin(0.7 * t + 1.0), 1.2 + 0.15 * std::sin(1.7 * t)}};
  }

  [[nodiscard]] Pose X_RB(double t) const { return setup_.path ? setup_.path(t) : usual_path(t); }
  [[nodiscard]] Pose truth() const { return X_RB(t_s); }
  [[nodiscard]] static Instant at(double t) {
    return instant_from_ns(1'000'000'000) + from_seconds(t);
  }

  /// Up to the next image: readings, then what the camera sees.
  /// @param visible  which tags; empty: all
  UpdateReport next_image(const MapKnowledge& map, const std::vector<int>& visible = {}) {
    const double image_s = t_s + setup_.image_period_s;
    while (imu_on && imu_s < image_s) {
      imu_s += setup_.imu_period_s;
      filter->propagate(reading(imu_s));
    }
    t_s = image_s;
    if (!imu_on) imu_s = t_s;
    seen = look(visible);
    return filter->update(seen, map);
  }

  [[nodiscard]] TagObservations look(const std::vector<int>& visible) {
    TagObservations out;
    out.exposed_at = at(t_s);
    std::normal_distribution<double> pixel(0, setup_.pixel_sigma);
    for (const auto& [id, X_RT] : tags) {
      if (!visible.empty() && std::find(visible.begin(), visible.end(), id) == visible.end())
        continue;
      const CameraMount& mount = sensors_.cameras.front();
      TagObservation tag =
          example_observation(id, edge_m, (truth() * mount.X_BV).inverse() * X_RT, mount.model);
      for (std::size_t k = 0; k < 4; ++k) {
        tag.ideal_from_raw[k].setIdentity();
        tag.corners_px[k] += Eigen::Vector2d(pixel(random_), pixel(random_));
        tag.raw_px[k] = tag.corners_px[k];
      }
      out.tags.push_back(tag);
    }
    return out;
  }

  [[nodiscard]] ImuSample reading(double t) {
    constexpr double h = 1e-3;
    const Pose before = X_RB(t - h);
    const Pose now = X_RB(t);
    const Pose after = X_RB(t + h);
    const Eigen::Vector3d a = (after.p - 2 * now.p + before.p) / (h * h);
    const ImuNoise& noise = *sensors_.imu;
    const double rate = std::sqrt(1.0 / setup_.imu_period_s);
    std::normal_distribution<double> gauss;
    const auto white = [&](double density) -> Eigen::Vector3d {
      return Eigen::Vector3d(gauss(random_), gauss(random_), gauss(random_)) * density * rate;
    };
    return {
        at(t),
        log_so3(before.q.conjugate() * after.q) / (2 * h) + white(noise.gyro_noise_rad_s_rtHz),
        now.q.conjugate() * (a + Eigen::Vector3d(0, 0, 9.81)) + white(noise.accel_noise_m_s2_rtHz)};
  }

  /// Known tag of a map at that pose, with standard deviation `sigma` per axis; 0: exact.
  [[nodiscard]] KnownTag known(int tag_id, const Pose& X_WT, double sigma) const {
    return {tag_id, edge_m, X_WT, Matrix6d::Identity() * sigma * sigma};
  }
  [[nodiscard]] std::vector<KnownTag> known_all(double sigma) const {
    std::vector<KnownTag> out;
    for (const auto& [id, X_RT] : tags) out.push_back(known(id, X_RT, sigma));
    return out;
  }
  [[nodiscard]] std::optional<TagBelief> belief(int tag_id) const {
    std::vector<TagBelief> beliefs;
    filter->tag_beliefs(beliefs);
    for (const TagBelief& belief : beliefs)
      if (belief.tag.tag_id == tag_id) return belief;
    return std::nullopt;
  }

  static constexpr double kQuarterTurn = 1.5707963267948966;

  std::map<int, Pose> tags;  ///< X_RT
  double edge_m{0.16};
  double t_s{0};
  double imu_s{0};
  bool imu_on{true};
  TagObservations seen;
  std::unique_ptr<BodyFilter> filter;

 private:
  Setup setup_;
  BodySensors sensors_;
  std::mt19937_64 random_;
};

/// Whether a report names this tag as dropped.
[[nodiscard]] inline bool names(const UpdateReport& report, int tag_id) {
  const int named = std::min(report.tags_dropped, static_cast<int>(UpdateReport::kMostNamed));
  return std::find(report.dropped_tags.begin(), report.dropped_tags.begin() + named, tag_id) !=
         report.dropped_tags.begin() + named;
}

}  // namespace fiducap
