#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The files that a tag map is read from and written to.
enum class MapFormat {
  kFiducap,  ///< Our own, complete.
  kCsv,      ///< Of the recordings.
  kTagslam,
  kBundles,  ///< apriltag_ros of ROS 1.
  kRcars,
  kAruco,  ///< ArUco library, MarkerMapper.
  kWpilib,
  kLimelight,
};

/// `fiducap`, `csv`, `tagslam`, `apriltag_ros`, `rcars`, `aruco`, `wpilib`, `limelight`.
[[nodiscard]] std::string_view name_of(MapFormat format);
[[nodiscard]] std::optional<MapFormat> map_format_from(std::string_view name);
/// For messages: all names, comma separated.
[[nodiscard]] std::string map_format_names();

/// The format of a text: by its content, else by the file's extension.
/// @return Error kUnsupported that explains how to name the format
[[nodiscard]] Expected<MapFormat> map_format_of(const std::string& file, std::string_view text);
/// The format of a file to be written, by its extension.
[[nodiscard]] Expected<MapFormat> map_format_of(const std::string& file);

/// What the files of other programs do not contain.
struct MapImportOptions {
  std::optional<double> edge_m{};  ///< Of all tags, where the file has no sizes.
  std::string family{};            ///< Empty: the file's, else tag36h11, with a remark.
};

/// A map of another program's file, with remarks on what was assumed or left out.
struct ImportedMap {
  TagMap map;  ///< Surveyed tags.
  std::vector<std::string> remarks;
};

/// A map as another program's file, with remarks on what that file cannot contain.
struct ExportedMap {
  std::string text;
  std::vector<std::string> remarks;
};

/// Length and width of a playing field, metres.
struct FieldSize {
  double length_m{};
  double width_m{};
};

[[nodiscard]] Expected<ImportedMap> read_map(MapFormat format, const std::string& text,
                                             const MapImportOptions& options,
                                             const std::string& context);
/// @param field  of WPILib's format, no other has one
[[nodiscard]] ExportedMap write_map(MapFormat format, const TagMap& map,
                                    std::optional<FieldSize> field = std::nullopt);

// Readers of single formats. They return an Error with line or path, what was expected and what
// came; nothing is guessed. @param context  file name for messages

/// Our own map text, complete: convention, sizes, covariances, states. Round trip below 1 µm at the
/// corners.
[[nodiscard]] std::string map_to_yaml(const TagMap& map);
/// The hash is kept when it is that of the content; an edited text is another map.
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
/// Names tags that are neither upright nor flat: their attitudes may come from another program.
[[nodiscard]] std::vector<std::string> field_remarks(const TagMap& map);
/// @param field  nullopt: as far as the tags reach from the origin
[[nodiscard]] ExportedMap map_to_wpilib_json(const TagMap& map, std::optional<FieldSize> field);

/// Limelight's .fmap, also of FTC: sizes in mm, 4 x 4 transforms row by row, the axes of WPILib
/// with the origin in the middle of the field.
[[nodiscard]] Expected<ImportedMap> map_from_limelight_json(const std::string& text,
                                                            const std::string& context);
[[nodiscard]] ExportedMap map_to_limelight_json(const TagMap& map, std::optional<FieldSize> field);

// Formats of other programs. At least one tag, or an Error. Writers leave out tags that the map
// itself does not trust, with a remark. Places are in workspace axes, tag axes are ours (x right, y
// up, z out of the face).
using MapReader = Expected<ImportedMap>(const std::string& text, const MapImportOptions& options,
                                        const std::string& context);

/// TagSLAM, `tagslam.yaml` and `poses.yaml`: tags of static bodies that have a pose. Rotations are
/// rotation vectors in radians; noises, 1-sigma along the tag's own axes, become covariances.
[[nodiscard]] MapReader map_from_tagslam_yaml;
/// One static body `workspace`. `poses.yaml` is a part of `tagslam.yaml`: the same text is both.
[[nodiscard]] ExportedMap map_to_tagslam_yaml(const TagMap& map);

/// apriltag_ros of ROS 1, `tags.yaml`: the layout of its one bundle; left-out places are zero,
/// left-out rotations none. Standalone tags have no place.
[[nodiscard]] MapReader map_from_bundle_yaml;
[[nodiscard]] ExportedMap map_to_bundle_yaml(const TagMap& map);

/// RCARS workspace: `calibratedTags` and `tags.tagN`, sizes are not in the file. Its passive qTI,
/// from inertial to tag axes, has the same four numbers as our q_WT.
[[nodiscard]] MapReader map_from_rcars_yaml;
[[nodiscard]] ExportedMap map_to_rcars_yaml(const TagMap& map);

/// Marker map of the ArUco library (MarkerMapper), OpenCV's YAML: four corners per id, clockwise
/// from the top-left, in metres, or in pixels, which need `edge_m`.
[[nodiscard]] MapReader map_from_aruco_yaml;
[[nodiscard]] ExportedMap map_to_aruco_yaml(const TagMap& map);

}  // namespace fiducap
