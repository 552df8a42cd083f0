#pragma once

#include <array>
#include <span>
#include <vector>

#include "detection/tag_geometry.hpp"
#include "simulation/bound_run.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// Errors of the corners of one tag in one image.
struct CornerError {
  Instant at{};
  int tag_id{};
  std::array<Eigen::Vector2d, 4> seen_px{};  ///< Raw.
  Vector8d off_px{Vector8d::Zero()};         ///< Seen − true, raw pixels.
  double sigma_px{};                         ///< Of the detector; 0: none.
};

/// Of all sightings of tags with known poses, in order of time; true extrinsics, true lens.
[[nodiscard]] std::vector<CornerError> corner_errors(const EstimationData& data);

/// Covariance, in sigmas, of each corner radially (from the middle of its tag) and tangentially.
struct ScatterShare {
  bound::Matrix8 passing{bound::Matrix8::Identity()};  ///< Of errors that are new in every image.
  bound::Matrix8 lasting{bound::Matrix8::Zero()};      ///< Of errors that fade.
};

/// True scatter of corners, without misread tags (off by more than a pixel and ten sigmas).
struct CornerScatter {
  // Modules narrower than this share their pixels with their neighbours.
  static constexpr double kNarrow_px = 2.5;

  double rms_px{};      ///< Of a coordinate.
  double chi_square{};  ///< Of a coordinate, by the detector's sigma; NaN: none.
  /// Correlation of a coordinate with the same one in the next image: 0 is white noise, 1 an error
  /// that stays.
  double to_next{};
  ScatterShare narrow, wide;  ///< Of tags with such modules.
  double fades_s{};           ///< Time until 1/e of the lasting errors is left.
  double lasting_share{};     ///< Of the variance in sigmas.
  int sightings{};

  /// Factor of the detector's sigma.
  [[nodiscard]] double excess() const;
};

/// @param runs  of the same experiment: a single one has too few sightings
[[nodiscard]] CornerScatter corner_scatter(std::span<const std::vector<CornerError>> runs);

/// The bound for corners with this scatter if all errors were white and equal …
[[nodiscard]] BoundRun white_bound(const EstimationData& data, KnowledgeCase knowledge,
                                   const CornerScatter& scatter);
/// … and as they are.
[[nodiscard]] BoundRun scatter_bound(const EstimationData& data, KnowledgeCase knowledge,
                                     const CornerScatter& scatter);

}  // namespace fiducap
