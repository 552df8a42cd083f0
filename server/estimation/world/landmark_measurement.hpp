#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap::world {

/// One point in one image of a camera that stood at X_WV.
struct LandmarkView {
  int slot{};  ///< Which six columns of the measurement belong to the camera's error.
  Pose X_WV;
  Eigen::Vector2d px{Eigen::Vector2d::Zero()};  ///< ideal pinhole pixel
  Eigen::Matrix2d ideal_from_raw{Eigen::Matrix2d::Identity()};
};

/// How far a followed point strays, raw pixels per coordinate, 1-sigma.
struct TrackNoise {
  double white_px{};  ///< Of each view on its own …
  double
      walk_px{};  ///< … and what each report adds for good: a followed point drifts off its place.
};

/// Where the rays of some views meet, and how well that is known.
struct Triangulated {
  Eigen::Vector3d p_W{Eigen::Vector3d::Zero()};
  double depth_m{};         ///< Before the last camera.
  double relative_sigma{};  ///< 1-sigma of 1 / depth, as a share of it, if the cameras stand where
                            ///< they are said to.
};

/// Least squares over all views, by direction and inverse depth in the last one (J. M. M. Montiel
/// et al., RSS 2006).
/// @param noise_px  of one coordinate, raw pixels
/// @return nullopt: the rays do not meet before all cameras, or it did not converge
[[nodiscard]] std::optional<Triangulated> triangulate(const CameraModel& model,
                                                      std::span<const LandmarkView> views,
                                                      double noise_px);

/// What the views of one landmark say about the cameras alone (A. I. Mourikis, S. I. Roumeliotis,
/// "A multi-state constraint Kalman filter", ICRA 2007): residual and Jacobian are whitened, then
/// turned so that the landmark's own three numbers stand in three rows, which are dropped.
///
/// Landmark and cameras have world-side errors: p = p̂ + δ, X_WV = Exp(ρ, φ) X̂_WV. A point in camera
/// axes changes by R_VW (δ − ρ − φ × p), so a common shift of all cameras is the shift δ = ρ + φ ×
/// p of the landmark *at any linearisation point*; what is left after δ is taken out knows nothing
/// of where the room is, by construction.
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

}  // namespace fiducap::world
