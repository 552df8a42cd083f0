#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "capture/lens/camera_model.hpp"
#include "estimation/world/filter_state.hpp"
#include "estimation/world/landmark_measurement.hpp"

namespace fiducap::world {

/// How much a followed point is trusted.
struct LandmarkRules {
  TrackNoise noise{0.12, 0.09};
  double gate_probability{0.95};  ///< A track is used when its chi-square is below this quantile.
  double most_relative_sigma{
      0.3};  ///< Of its inverse depth; worse ones say little, and that not linearly.
};

/// What one joint update with landmarks did.
struct LandmarkReport {
  int used{};
  int rejected{};  ///< Failed the gate.
  int shallow{};   ///< Depth not known well enough, or none.
  double nis{};
  int nis_dof{};
};

/// Corrects the state by landmarks that the clones of its cameras saw, all of one image jointly.
/// Landmarks never enter the state. Order of use: begin, add per landmark, apply. Keeps its memory.
class LandmarkUpdate final {
 public:
  static constexpr int kMostLandmarks = 24;  ///< In one update; further ones are not looked at.

  LandmarkUpdate(int clones, const LandmarkRules& rules);

  void begin();
  [[nodiscard]] bool is_full() const { return landmarks_ == kMostLandmarks; }
  /// Triangulates, gates against the prior covariance, and stacks.
  void add(const FilterState& state, const CameraModel& model, std::span<const LandmarkView> views);
  LandmarkReport apply(FilterState& state);

 private:
  [[nodiscard]] bool passes_gate(const FilterState& state);
  /// More rows than columns say no more than as many: reflections make the stack triangular.
  void compress();

  int columns_;
  LandmarkRules rules_;
  std::array<double, 2 * LandmarkMeasurement::kMostViews + 1> gates_{};  ///< By degrees of freedom.
  LandmarkMeasurement one_;
  LandmarkReport report_;
  int landmarks_{0};
  int rows_{0};
  Eigen::MatrixXd H_;  ///< rows × columns, columns are the clones' errors
  Eigen::VectorXd y_;
  Eigen::MatrixXd HP_;  ///< of one landmark
  Eigen::MatrixXd S_;
  Eigen::MatrixXd PHt_;  ///< n × rows
  Eigen::VectorXd dx_;
  std::vector<unsigned char> held_;  ///< Memory of kalman::shrink.
};

}  // namespace fiducap::world
