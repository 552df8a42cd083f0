#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "estimation/body_filter.hpp"

namespace fiducap {

/// A wall of six tags before which a body moves to and fro, with noisy readings and corners: the
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
    bool has_imu{true};
  };

  explicit ExampleRoom(Setup setup);

  [[nodiscard]] static Pose X_RB(double t);
  [[nodiscard]] Pose truth() const { return X_RB(t_s); }
  [[nodiscard]] static Instant at(double t) {
    return instant_from_ns(1'000'000'000) + from_seconds(t);
  }

  /// Up to the next image: readings, then what the camera sees.
  /// @param map  without `whole`: that of these tags, whose errors are independent
  /// @param visible  which tags; empty: all
  UpdateReport next_image(const MapKnowledge& map, const std::vector<int>& visible = {});
  /// Several images. @return report of the last one
  UpdateReport images(int count, const MapKnowledge& map = {},
                      const std::vector<int>& visible = {});
  [[nodiscard]] TagObservations look(const std::vector<int>& visible);

  [[nodiscard]] bool is_anchored() const {
    return filter->running() && filter->estimate().anchored;
  }
  /// The room in the filter's workspace, by the present estimate.
  [[nodiscard]] Pose X_WR() const { return filter->estimate().X_WB * truth().inverse(); }
  /// Distance of the estimate from the truth.
  [[nodiscard]] double error_m(const Pose& X_WR = {}) const;
  /// Root of the trace of the position's covariance.
  [[nodiscard]] double sigma_m() const;
  /// Of the body's pose, per degree of freedom, in a known map.
  [[nodiscard]] double pose_nees() const;

  /// Known tag of a map at that pose, with standard deviation `sigma` per axis; 0: exact.
  [[nodiscard]] KnownTag known(int tag_id, const Pose& X_WT, double sigma) const {
    return {tag_id, edge_m, X_WT, Matrix6d::Identity() * sigma * sigma};
  }
  [[nodiscard]] KnownTag known(int tag_id, double sigma) const {
    return known(tag_id, tags.at(tag_id), sigma);
  }
  [[nodiscard]] std::vector<KnownTag> known_all(double sigma) const;
  [[nodiscard]] std::vector<TagBelief> beliefs() const;
  [[nodiscard]] std::optional<TagBelief> belief(int tag_id) const;
  /// The filter has a tag where it is.
  void expect_belief(int tag_id, double within_m, const Pose& X_WR = {}) const;

  static constexpr double kQuarterTurn = 1.5707963267948966;

  std::map<int, Pose> tags;  ///< X_RT
  double edge_m{0.16};
  double t_s{0};
  double imu_s{0};
  bool imu_on{true};
  std::unique_ptr<BodyFilter> filter;

 private:
  [[nodiscard]] ImuSample reading(double t);
  [[nodiscard]] const KnownMap* whole_of(std::span<const KnownTag> map);

  Setup setup_;
  KnownMap whole_;
  BodySensors sensors_;
  std::mt19937_64 random_;
};

/// Whether a report names this tag as dropped.
[[nodiscard]] bool names(const UpdateReport& report, int tag_id);
void erase_tag(std::vector<KnownTag>& map, int tag_id);

}  // namespace fiducap
