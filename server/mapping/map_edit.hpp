#pragma once

#include <optional>
#include <string>
#include <vector>

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

/// What is changed in a map by hand.
struct MapEdit {
  std::vector<int> forget;      ///< Ids of tags that go …
  std::vector<int> quarantine;  ///< … and that are kept and not used.
  std::optional<SurveyedTag> survey{};
};

/// @return Error naming the tag and what was expected: a tag that is not there, nothing to change,
/// a survey without sigma, attitude or edge of a new tag
[[nodiscard]] Expected<TagMap> edited_map(TagMap map, const MapEdit& edit);

/// `tag 7 forgotten, tag 3 surveyed`, for the history.
[[nodiscard]] std::string words_of(const MapEdit& edit);

/// What the map's ties say of a tag is not true any more.
void drop_ties(TagMap& map, int tag_id);

}  // namespace fiducap
