#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "support/bound/bound_problem.hpp"

namespace fiducap::bound {

/// What several bodies together can know of the tags: smoothing bound of their one map.
struct JointMap {
  std::vector<RecordedTag> tags;  ///< That hang together with the reference tag, by id; true poses.
  /// Of their errors as TagsCovariance has them, against W: place of the reference tag and heading
  /// of its most level axis are exact, by definition.
  Eigen::MatrixXd P;
};

/// Each body's tags are known up to a shift and a turn about the vertical (4 numbers), since its
/// own bound began with those of its start, exactly. So with its information Λ = P⁻¹ and the tags'
/// errors G by those four (6n × 4), what it says of tags in the axes of all is
///
///     Λ' = Λ − Λ G (Gᵀ Λ G)⁻¹ Gᵀ Λ
///
/// (shift and turn marginalised with no prior). Bodies have nothing in common but the tags: Λ'
/// adds up. What is left open in the sum is one shift and turn, which the definition of W fixes (a
/// minimal constraint; S-transformation: W. Baarda, "S-transformations and criterion matrices",
/// 1973).
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
/// @param ids  of whom; those that the map has not are left out
[[nodiscard]] MapFigures figures_of(const JointMap& map, std::span<const int> ids);

}  // namespace fiducap::bound
