#pragma once

#include <Eigen/Core>
#include <array>

#include "capture/lens/camera_model.hpp"
#include "detection/tag_geometry.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/estimator_config.hpp"

namespace fiducap {

/// Measurement noise of one camera's corners: 1-sigma of each coordinate, raw pixels.
///
/// σ² = σ_detector² + f². The detector estimates its part for each tag (size, blur, contrast:
/// TagObservation::corner_sigma_px) and for each side. The rest f, errors of lens model and print,
/// is learned: it starts at `corner_noise_px` and follows the median of the tags' Mahalanobis
/// distances, which is robust to wrong ids and occluded corners.
///
/// A tag that does not move in the image repeats its error, which depends on its position on the
/// pixel grid. The n-th sighting at one place therefore has n times the noise, so that all of them
/// count less than two, and f is not reduced by it. Corners of other detectors have white noise.
class CornerNoise final {
 public:
  /// @param learns  false: `corner_noise_px` for every corner (RCARS)
  /// @param lens    for lens_error_px; nullptr: exact
  explicit CornerNoise(const EstimatorConfig& config, bool learns,
                       const CameraMount* lens = nullptr);

  [[nodiscard]] double of(const TagObservation& seen) const;
  /// Whether covariance() is not a multiple of the identity: sides have their own sigmas.
  [[nodiscard]] bool is_uneven(const TagObservation& seen) const {
    return learns_ && (seen.knows_sides() || lens_error_px_ > 0);
  }
  /// Noise covariance where it is uneven. @param more_px  added to each coordinate, 1-sigma
  [[nodiscard]] Matrix8d covariance(const TagObservation& seen, double more_px) const;
  /// Initial f, learned by another filter from the same images.
  void begin_with(double unexplained_px);
  /// Views of a new tag, each with a free distance, fit with a chi-square of `cost`: raises the
  /// noise if it is too large. So a start learns it before any tag is in the state.
  void learn_from_views(const TagObservation& seen, double cost, int degrees_of_freedom);
  /// of() relative to its initial value.
  [[nodiscard]] double growth(const TagObservation& seen) const;
  /// Allows f to fall quickly, when the calibration is confirmed: otherwise a small f would reject
  /// images before a wrong lens is found. f never rises quickly: jitter of stamps would be taken
  /// for corner noise.
  void fall_quickly(bool may) { falls_quickly_ = may; }
  /// Learns from one tag of an image, used or not.
  /// @param distance  squared Mahalanobis distance, 8 degrees of freedom
  /// @param share     share of corner noise in the innovation covariance, 0 … 1
  void learn(const TagObservation& seen, double distance, double share);
  /// The learned part f.
  [[nodiscard]] double unexplained_px() const { return unexplained_px_; }

 private:
  /// Position of a tag at its last informative sighting.
  struct Place {
    int tag_id{-1};
    Eigen::Vector2d px{Eigen::Vector2d::Zero()};
    int looks{0};                                      ///< Sightings at `px`.
    Eigen::Vector2d part_px{Eigen::Vector2d::Zero()};  ///< Part of the image, for the lens error.
    int part_looks{0};                                 ///< Sightings in that part.
  };
  static constexpr std::size_t kPlaces = 256;

  [[nodiscard]] double repeated(const TagObservation& seen) const;
  [[nodiscard]] double lens_px(const TagObservation& seen) const;
  /// @return whether it was seen at another place before
  [[nodiscard]] bool has_moved(const TagObservation& seen);

  double start_px_;  ///< As configured.
  double lens_error_px_{0};
  double lens_reach_px_{0};  ///< Correlation length of the lens error.
  double begun_px_;          ///< f at the beginning.
  double unexplained_px_;
  double least_px_;  ///< f when a tag last moved.
  double step_;
  double one_sided_{0};  ///< Recent distances relative to their median: 1 all above, -1 all below.
  bool learns_;
  bool falls_quickly_{false};
  std::array<Place, kPlaces> places_;
};

}  // namespace fiducap
