#pragma once

#include <array>
#include <span>
#include <vector>

#include "detection/tag_geometry.hpp"
#include "simulation/bound_run.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// What the corners of one tag in one image were off.
struct CornerError {
  Instant at{};
  int tag_id{};
  std::array<Eigen::Vector2d, 4> seen_px{};  ///< Raw.
  Vector8d off_px{Vector8d::Zero()};         ///< Seen − true, raw pixels.
  double sigma_px{};                         ///< Of the detector; 0: none.
};

/// Of all sightings of tags whose place is known, in order of time; true extrinsics, true lens.
[[nodiscard]] std::vector<CornerError> corner_errors(const EstimationData& data);

/// Covariance, in sigmas, of each corner away from the middle of its tag and across …
struct ScatterShare {
  bound::Matrix8 passing{bound::Matrix8::Identity()};  ///< … of what is new in every image …
  bound::Matrix8 lasting{bound::Matrix8::Zero()};      ///< … and of what fades.
};

/// How corners scatter in truth. Misread tags (off by more than a pixel and ten sigmas) are not in
/// it.
struct CornerScatter {
  // Modules narrower than this share their pixels with what lies beside them.
  static constexpr double kNarrow_px = 2.5;

  double rms_px{};      ///< Of a coordinate.
  double chi_square{};  ///< Of a coordinate, by the detector's sigma; NaN: none.
  /// Correlation of a coordinate with the same one in the next image: 0 is white noise, 1 an error
  /// that stays.
  double to_next{};
  ScatterShare narrow, wide;  ///< Of tags with such modules.
  double fades_s{};           ///< Until 1/e of what lasts is left.
  double lasting_share{};     ///< Of the variance in sigmas.
  int sightings{};

  /// What to multiply the detector's sigma by.
  [[nodiscard]] double excess() const;
};

/// @param runs  of the same experiment: a single one has too few sightings
[[nodiscard]] CornerScatter corner_scatter(std::span<const std::vector<CornerError>> runs);

/// The bound for corners with this scatter, if all errors were white and equal …
[[nodiscard]] BoundRun white_bound(const EstimationData& data, KnowledgeCase knowledge,
                                   const CornerScatter& scatter);
/// … and as they are.
[[nodiscard]] BoundRun scatter_bound(const EstimationData& data, KnowledgeCase knowledge,
                                     const CornerScatter& scatter);

}  // namespace fiducap
