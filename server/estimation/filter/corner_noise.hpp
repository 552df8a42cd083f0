#pragma once

#include <array>

#include <Eigen/Core>

#include "capture/lens/camera_model.hpp"
#include "detection/corner_covariance.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/estimator_config.hpp"

namespace fiducap {

/// How well the corners of one camera are measured: 1-sigma of each coordinate, raw pixels.
///
/// σ² = σ_detector² + f². The detector knows its part for each tag (size, blur, contrast:
/// TagObservation::corner_sigma_px), and for each of its sides. The rest f, what lens model and
/// print leave, is learned: it starts at `corner_noise_px` and follows the median of the tags'
/// Mahalanobis distances, which wrong ids and covered corners do not move.
///
/// A tag that stands still in the image repeats its error, which goes by how it lies on the grid of
/// pixels: a body at rest would soon be sure of what one image says. The n-th look at the same
/// place counts for a look n times as noisy, so that all of them are worth less than two. Neither
/// do its small distances say anything: f does not sink by a tag that has not moved. Corners that
/// no detector here has measured are taken as white.
class CornerNoise final {
 public:
  /// @param learns  false: `corner_noise_px` for every corner, as in the paper
  /// @param lens    for lens_error_px; nullptr: exact
  explicit CornerNoise(const EstimatorConfig& config, bool learns,
                       const CameraMount* lens = nullptr);

  [[nodiscard]] double of(const TagObservation& seen) const;
  /// Whether it is not the same in all directions: where each side has sigmas of its own. A line
  /// through white noise is turned by more than it is shifted.
  [[nodiscard]] bool is_uneven(const TagObservation& seen) const {
    return learns_ && (seen.knows_sides() || lens_error_px_ > 0);
  }
  /// The whole of it where it is uneven. @param more_px  beside all that, of each coordinate
  [[nodiscard]] Matrix8d covariance(const TagObservation& seen, double more_px) const;
  /// Nothing is learned yet, but by another filter from the same images: f is no larger than this.
  void begin_with(double unexplained_px);
  /// of() as a multiple of what it was at the beginning.
  [[nodiscard]] double growth(const TagObservation& seen) const;
  /// Whether nothing but corners can be off: f may come down quickly. Else images would be gated by
  /// a small f before a wrong lens is found; and it never rises quickly, as stamps that jitter
  /// would be taken for noise of corners.
  void fall_quickly(bool may) { falls_quickly_ = may; }
  /// What one tag of an image says, used or not.
  /// @param distance  its squared Mahalanobis distance, 8 degrees of freedom
  /// @param share     of its innovation covariance that is corner noise, 0 … 1
  void learn(const TagObservation& seen, double distance, double share);
  /// f
  [[nodiscard]] double unexplained_px() const { return unexplained_px_; }

 private:
  /// Where a tag was when it last taught something new.
  struct Place {
    int tag_id{-1};
    Eigen::Vector2d px{Eigen::Vector2d::Zero()};
    int looks{0};                                      ///< That have taught there.
    Eigen::Vector2d part_px{Eigen::Vector2d::Zero()};  ///< Of the image, that it has been in …
    int part_looks{0};                                 ///< … so often since it came there.
  };
  static constexpr std::size_t kPlaces = 256;

  [[nodiscard]] double once_px(const TagObservation& seen) const;
  [[nodiscard]] double repeated(const TagObservation& seen) const;
  void add_lens(const TagObservation& seen, Matrix8d& R) const;
  [[nodiscard]] double lens_px(const TagObservation& seen) const;
  /// @return whether it had been seen elsewhere before
  [[nodiscard]] bool has_moved(const TagObservation& seen);

  double start_px_;  ///< As configured.
  double lens_error_px_{0};
  double lens_reach_px_{0};  ///< Corners this near to each other are off alike.
  double begun_px_;          ///< f at the beginning.
  double unexplained_px_;
  double least_px_;  ///< f when a tag last moved.
  double step_;
  double one_sided_{0};  ///< Whether distances were above (1) or below (-1) their median of late.
  bool learns_;
  bool falls_quickly_{false};
  std::array<Place, kPlaces> places_;
};

}  // namespace fiducap
