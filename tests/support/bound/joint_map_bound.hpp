#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "support/bound/bound_problem.hpp"

namespace fiducap::bound {

/// Smoothing bound of the tags, seen by several bodies: their one map.
struct JointMap {
  std::vector<RecordedTag> tags;  ///< Component of the reference tag, by id; true poses.
  /// Of their errors as in TagsCovariance, in W: place of the reference tag and heading of its most
  /// level axis are exact, by definition.
  Eigen::MatrixXd P;
};

/// Each body's tags are known up to a translation and a heading (4 numbers), which its own bound
/// fixed at the start. With its information Λ = P⁻¹ and the tags' errors G by those four (6n × 4),
/// its information about the tags in common axes is
///
///     Λ' = Λ − Λ G (Gᵀ Λ G)⁻¹ Gᵀ Λ
///
/// (marginalised without a prior). Bodies share only the tags: Λ' adds up. The sum leaves one
/// translation and heading open, which the definition of W fixes (a minimal constraint;
/// S-transformation: W. Baarda, "S-transformations and criterion matrices", 1973).
/// @param tags    of the room, true poses; z is up
/// @param bodies  CausalBound::tags() at the end of each one's data; those that share no tag with
///                the reference tag's, directly or over others, count for nothing
/// @pre a body has seen the reference tag; each body a tag
[[nodiscard]] JointMap joint_map_bound(std::span<const RecordedTag> tags, int reference_tag,
                                       std::span<const TagsCovariance> bodies);

/// RMS over tags, the reference tag among them.
struct MapFigures {
  double raw_m{};    ///< Place in W.
  double level_m{};  ///< After aligning the whole with the truth (fit_yaw_and_shift).
  int tags{};
};
/// @param ids  tags; those outside of the map are left out
[[nodiscard]] MapFigures figures_of(const JointMap& map, std::span<const int> ids);

}  // namespace fiducap::bound
