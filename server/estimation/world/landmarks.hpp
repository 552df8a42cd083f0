#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/world/filter_state.hpp"
#include "estimation/world/image_memory.hpp"

namespace fiducap::world {

/// One point in one image of a camera at X_WV.
struct LandmarkView {
  int slot{};  ///< Index of the camera's six columns in the measurement.
  Pose X_WV;
  Eigen::Vector2d px{Eigen::Vector2d::Zero()};  ///< ideal pinhole pixel
  Eigen::Matrix2d ideal_from_raw{Eigen::Matrix2d::Identity()};
};

/// Noise of a tracked point, raw pixels per coordinate, 1-sigma.
struct TrackNoise {
  double white_px{};  ///< Independent error of each view.
  double walk_px{};   ///< Random walk per view: a tracked point drifts.
};

/// Intersection of the rays of some views.
struct Triangulated {
  Eigen::Vector3d p_W{Eigen::Vector3d::Zero()};
  double depth_m{};         ///< Before the last camera.
  double relative_sigma{};  ///< 1-sigma of 1 / depth relative to it, at exact camera poses.
};

/// Least squares over all views, by direction and inverse depth in the last one (J. M. M. Montiel
/// et al., RSS 2006).
/// @param noise_px  of one coordinate, raw pixels
/// @return nullopt: the rays do not intersect before all cameras, or no convergence
[[nodiscard]] std::optional<Triangulated> triangulate(const CameraModel& model,
                                                      std::span<const LandmarkView> views,
                                                      double noise_px);

/// Information of the views of one landmark about the cameras alone (A. I. Mourikis, S. I.
/// Roumeliotis, "A multi-state constraint Kalman filter", ICRA 2007): residual and Jacobian are
/// whitened and rotated so that the landmark's three numbers are in three rows, which are dropped.
///
/// Landmark and cameras have world-side errors: p = p̂ + δ, X_WV = Exp(ρ, φ) X̂_WV. A point in camera
/// axes changes by R_VW (δ − ρ − φ × p), so a common motion of all cameras equals the shift δ = ρ +
/// φ × p of the landmark *at any linearisation point* and is eliminated with δ.
class LandmarkMeasurement final {
 public:
  static constexpr int kMostViews = 16;

  /// @param slots  of six columns each
  explicit LandmarkMeasurement(int slots);

  /// @pre 3 ≤ views.size() ≤ kMostViews, in order of time
  /// @return false: the landmark is not before every camera
  bool build(const CameraModel& model, std::span<const LandmarkView> views,
             const Eigen::Vector3d& p_W, const TrackNoise& noise);

  [[nodiscard]] int rows() const { return rows_; }
  /// seen − predicted, unit covariance; rows()
  [[nodiscard]] auto y() const { return y_.segment(kLandmarkSize, rows_); }
  /// ∂ predicted / ∂ errors of the cameras; rows() × 6 slots
  [[nodiscard]] auto H() const { return H_.middleRows(kLandmarkSize, rows_); }

 private:
  static constexpr int kLandmarkSize = 3;

  void whiten(int views, const TrackNoise& noise);
  void turn_landmark_away(int rows);

  int rows_{0};
  Eigen::VectorXd y_;  ///< All u first, then all v.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> H_;
  Eigen::Matrix<double, Eigen::Dynamic, 3> H_landmark_;
};

/// Noise and acceptance of tracked points.
struct LandmarkRules {
  TrackNoise noise{0.12, 0.09};
  double gate_probability{0.95};    ///< Quantile of chi-square below which a track is used.
  double most_relative_sigma{0.3};  ///< Of its inverse depth; worse ones are not linear.
};

/// Result of one joint update with landmarks.
struct LandmarkReport {
  int used{};
  int rejected{};  ///< By the gate.
  int shallow{};   ///< Depth uncertain or not determined.
  double nis{};
  int nis_dof{};
};

/// Corrects the state by landmarks seen by its clones, all of one image jointly. Landmarks never
/// enter the state. Order of use: begin, add per landmark, apply. Keeps its memory.
class LandmarkUpdate final {
 public:
  static constexpr int kMostLandmarks = 24;  ///< In one update; further ones are ignored.

  LandmarkUpdate(int clones, const LandmarkRules& rules);

  void begin();
  [[nodiscard]] bool is_full() const { return landmarks_ == kMostLandmarks; }
  /// Triangulates, gates by the prior covariance, and stacks.
  void add(const FilterState& state, const CameraModel& model, std::span<const LandmarkView> views);
  LandmarkReport apply(FilterState& state);

 private:
  [[nodiscard]] bool passes_gate(const FilterState& state);
  /// Reduces the stack to a triangle when it has more rows than columns.
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
  std::vector<unsigned char> held_;  ///< Scratch of kalman::shrink().
};

/// Manages the clones of the last images and selects the tracks for each update.
///
/// A track is used when it ends or is as long as the window; its continuation is a new landmark.
/// The ages of the points determine this, so that an image processed again (ImageMemory) uses the
/// same tracks.
class CloneWindow final {
 public:
  static constexpr int kClones = 10;

  CloneWindow(std::size_t cameras, const LandmarkRules& rules);

  /// Replaces the oldest clone by the camera at the present image.
  static void clone(FilterState& state, int camera, long image);
  /// Corrects the state by the tracks due with this image. @pre clone() was called for it
  LandmarkReport correct(FilterState& state, ImageMemory& memory, const CameraModel& model,
                         int camera);

 private:
  struct Seen {
    int slot;
    const TagObservations* image;
  };
  struct Due {
    std::uint32_t track;
    int first_age;
    int last_age;
  };

  void list_images(const FilterState& state, ImageMemory& memory, int camera);
  void list_due();
  void gather(const FilterState& state, std::uint32_t track, int first_age, int last_age);

  int longest_;  ///< Views of one landmark: each camera has its share of the window.
  LandmarkUpdate update_;
  std::vector<Seen> images_;  ///< Of one camera, oldest first.
  std::vector<Due> due_;
  std::vector<LandmarkView> views_;
};

}  // namespace fiducap::world
