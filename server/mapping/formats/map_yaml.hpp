#pragma once

#include <string>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Our own map text, complete: convention, sizes, covariances, states. Round trip below 1 µm at the
/// corners.
[[nodiscard]] std::string map_to_yaml(const TagMap& map);
/// The hash is kept when the content still has it; an edited text is another map.
/// @param context  file name for messages
/// @return Error with line and field when the text is not a map; nothing is guessed.
[[nodiscard]] Expected<TagMap> map_from_yaml(const std::string& text, const std::string& context);

/// `id,size,px,py,pz,qw,qx,qy,qz`, world_from_tag: the recordings' format (data/README.md). Read as
/// surveyed, exact tags.
[[nodiscard]] std::string map_to_csv(const TagMap& map);
[[nodiscard]] Expected<TagMap> map_from_csv(const std::string& text, const std::string& context);

/// WPILib / PhotonVision field layout. Its tag axes are x out of the face, y to the viewer's right,
/// z up; sizes are not in the file, so one is given (0.1651 m is usual). Field axes become the
/// workspace; tags are surveyed and exact.
[[nodiscard]] Expected<TagMap> map_from_wpilib_json(const std::string& text, double edge_m,
                                                    const std::string& context);

}  // namespace fiducap
