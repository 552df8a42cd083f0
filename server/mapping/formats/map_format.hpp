#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "mapping/formats/foreign_map.hpp"

namespace fiducap {

/// The files that a tag map is read from and written to.
enum class MapFormat {
  kFiducap,  ///< Ours, complete.
  kCsv,      ///< Of the recordings.
  kTagslam,
  kBundles,  ///< apriltag_ros of ROS 1.
  kRcars,
  kAruco,  ///< ArUco library, MarkerMapper.
  kWpilib,
};

/// `fiducap`, `csv`, `tagslam`, `apriltag_ros`, `rcars`, `aruco`, `wpilib`.
[[nodiscard]] std::string_view name_of(MapFormat format);
[[nodiscard]] std::optional<MapFormat> map_format_from(std::string_view name);
/// For messages: all names, comma separated.
[[nodiscard]] std::string map_format_names();

/// What a text is: by what stands in it, else by the end of the file's name.
/// @return Error kUnsupported that says how to name the format
[[nodiscard]] Expected<MapFormat> map_format_of(const std::string& file, std::string_view text);
/// What a file to be written shall be, by the end of its name.
[[nodiscard]] Expected<MapFormat> map_format_of(const std::string& file);

[[nodiscard]] Expected<ImportedMap> read_map(MapFormat format, const std::string& text,
                                             const MapImportOptions& options,
                                             const std::string& context);
/// @param field  of WPILib's format, no other has one
[[nodiscard]] ExportedMap write_map(MapFormat format, const TagMap& map,
                                    std::optional<FieldSize> field = std::nullopt);

}  // namespace fiducap
