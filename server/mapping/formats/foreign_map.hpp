#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// What the files of other programs do not say.
struct MapImportOptions {
  std::optional<double> edge_m{};  ///< Of all tags, where the file has no sizes.
  std::string family{};            ///< Empty: what the file says, else tag36h11, which is remarked.
};

/// A map of another program's file, and what had to be assumed or left out to take it in.
struct ImportedMap {
  TagMap map;  ///< Surveyed tags.
  std::vector<std::string> remarks;
};

/// A map as another program's file, and what that file cannot say.
struct ExportedMap {
  std::string text;
  std::vector<std::string> remarks;
};

/// Length and width of a playing field, metres.
struct FieldSize {
  double length_m{};
  double width_m{};
};

// Readers: Error with line or path, what was expected and what came; at least one tag or an Error.
// @param context  file name for messages
// Writers leave out tags that the map itself does not trust and remark it. Places are in workspace
// axes. Tag axes are ours (x right, y up, z out of the face) in all of these formats but WPILib's.

/// TagSLAM, `tagslam.yaml` and `poses.yaml`: tags of static bodies that have a pose. Rotations are
/// rotation vectors in radians; noises, 1-sigma along the tag's own axes, become covariances.
[[nodiscard]] Expected<ImportedMap> map_from_tagslam_yaml(const std::string& text,
                                                          const MapImportOptions& options,
                                                          const std::string& context);
/// One static body `workspace`. `poses.yaml` is a part of `tagslam.yaml`: the same text is both.
[[nodiscard]] ExportedMap map_to_tagslam_yaml(const TagMap& map);

/// apriltag_ros of ROS 1, `tags.yaml`: the layout of its one bundle; left-out places are zero,
/// left-out rotations none. Standalone tags have no place.
[[nodiscard]] Expected<ImportedMap> map_from_bundle_yaml(const std::string& text,
                                                         const MapImportOptions& options,
                                                         const std::string& context);
[[nodiscard]] ExportedMap map_to_bundle_yaml(const TagMap& map);

/// RCARS workspace: `calibratedTags` and `tags.tagN`, sizes are not in the file. Its passive qTI,
/// which takes inertial coordinates to the tag's, has the same four numbers as our q_WT.
[[nodiscard]] Expected<ImportedMap> map_from_rcars_yaml(const std::string& text,
                                                        const MapImportOptions& options,
                                                        const std::string& context);
[[nodiscard]] ExportedMap map_to_rcars_yaml(const TagMap& map);

/// Marker map of the ArUco library (MarkerMapper), OpenCV's YAML: four corners per id, clockwise
/// from the top-left, in metres, or in pixels, which need `edge_m`.
[[nodiscard]] Expected<ImportedMap> map_from_aruco_yaml(const std::string& text,
                                                        const MapImportOptions& options,
                                                        const std::string& context);
[[nodiscard]] ExportedMap map_to_aruco_yaml(const TagMap& map);

/// WPILib / PhotonVision field layout; its reader is in map_yaml.hpp. Sizes are lost.
/// @param field  nullopt: as far as the tags reach from the origin
[[nodiscard]] ExportedMap map_to_wpilib_json(const TagMap& map, std::optional<FieldSize> field);

}  // namespace fiducap
