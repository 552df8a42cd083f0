#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// A tag whose place in W was measured.
struct SurveyedTag {
  int tag_id{};
  Eigen::Vector3d p_WT{Eigen::Vector3d::Zero()};
  std::optional<Eigen::Quaterniond> q_WT{};  ///< nullopt: as the map has it.
  double sigma_m{};  ///< Of each coordinate; of the attitude the same at half the tag's edge.
  double edge_m{};   ///< 0: as the map has it.
};

/// Changes of a stored map by an operator.
struct MapEdit {
  std::vector<int> forget;      ///< Ids of tags that are removed …
  std::vector<int> quarantine;  ///< … and that are kept and not used.
  std::optional<SurveyedTag> survey{};
};

/// @return Error naming the tag and what was expected: an unknown tag, nothing to change, a survey
/// without sigma, attitude or edge of a new tag
[[nodiscard]] Expected<TagMap> edited_map(TagMap map, const MapEdit& edit);

/// `tag 7 forgotten, tag 3 surveyed`, for the history.
[[nodiscard]] std::string words_of(const MapEdit& edit);

/// Removes a tag from the map's correlations: they do not hold for it any more.
void drop_correlations(TagMap& map, int tag_id);
/// Without some tags and their correlations.
[[nodiscard]] KnownMap without_tags(KnownMap known, const std::function<bool(int tag_id)>& is_out);

/// The centre of a tag in the room, measured by the user.
struct MeasuredPlace {
  int tag_id{};
  Eigen::Vector3d p_RT{Eigen::Vector3d::Zero()};
};

/// The pose of W in the room.
struct MapAlignment {
  struct Residual {
    int tag_id{};
    Eigen::Vector3d off_m;  ///< Measured minus aligned, room axes.
  };
  Pose X_RW;
  std::vector<Residual> residuals;  ///< In the order of the places.
};

/// Aligns the map with places measured in the room: yaw and shift, least squares. The vertical is
/// gravity's in both, and the scale is not changed.
/// @param most_off_m  largest residual of a correct measurement
/// @return Error naming the tag when a place contradicts the others or is not usable: less than
/// three tags, one twice, not in the map, all above each other; and when axes or units are wrong
/// (mirrored, millimetres)
[[nodiscard]] Expected<MapAlignment> align(const TagMap& map, std::span<const MeasuredPlace> places,
                                           double most_off_m);

/// The distance between the centres of two tags.
struct TagDistance {
  double distance_m{};
  double sigma_m{};           ///< With the correlation of their errors, where the map has it.
  bool is_correlated{false};  ///< It has.
};

/// @return Error naming the tag that the map does not have, or does not use
[[nodiscard]] Expected<TagDistance> distance_between(const TagMap& map, int first_id,
                                                     int second_id);

/// Stores the present map as a version. Empty: without a name.
struct CommitVersion {
  std::string name;
};
/// A stored version with a name (its comment) is never thinned out.
struct NameVersion {
  std::int64_t version{};
  std::string name;
};
/// Serves a stored version again, as a new version.
struct RollBack {
  std::int64_t version{};
};
/// Aligns the workspace with the room by measured tags.
struct AlignMap {
  std::vector<MeasuredPlace> places;
};
/// See MapBuilder::quarantine and forget.
struct QuarantineTag {
  int tag_id{};
};
struct ForgetTag {
  int tag_id{};
};

/// A change of the served map by an operator.
using MapChange =
    std::variant<CommitVersion, NameVersion, RollBack, AlignMap, QuarantineTag, ForgetTag>;
/// Those that need the store.
using StoreChange = std::variant<CommitVersion, NameVersion, RollBack>;

}  // namespace fiducap
