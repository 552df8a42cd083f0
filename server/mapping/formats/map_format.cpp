#include "mapping/formats/map_format.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <utility>

#include "mapping/formats/map_exchange.hpp"

namespace fiducap {

namespace {

/// Keys that only one kind of YAML has at its top.
struct TopKey {
  std::string_view key;
  MapFormat format;
};
constexpr std::array kTopKeys{
    TopKey{"format", MapFormat::kFiducap},         TopKey{"bodies", MapFormat::kTagslam},
    TopKey{"tag_bundles", MapFormat::kBundles},    TopKey{"standalone_tags", MapFormat::kBundles},
    TopKey{"calibratedTags", MapFormat::kRcars},   TopKey{"aruco_bc_nmarkers", MapFormat::kAruco},
    TopKey{"aruco_bc_markers", MapFormat::kAruco},
};

std::string_view without_blanks(std::string_view text) {
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

/// The first key at the beginning of a line that only one format has; bundles also further in.
std::optional<MapFormat> format_by_keys(std::string_view text) {
  std::optional<MapFormat> indented;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    const std::string_view key = without_blanks(line.substr(0, line.find(':')));
    const std::size_t begin = std::min(key.find_first_not_of(" \t"), key.size());
    for (const TopKey& one : kTopKeys) {
      if (key.size() == line.size() || key.substr(begin) != one.key) continue;
      if (begin == 0) return one.format;
      if (one.format == MapFormat::kBundles) indented = one.format;
    }
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
  return indented;
}

std::optional<MapFormat> format_by_content(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  if (text.starts_with("id,")) return MapFormat::kCsv;
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first != std::string_view::npos && text[first] == '{')
    return text.find("fiducap-map") != std::string_view::npos     ? MapFormat::kFiducap
           : text.find("\"fiducials\"") != std::string_view::npos ? MapFormat::kLimelight
                                                                  : MapFormat::kWpilib;
  return format_by_keys(text);
}

std::string end_of(const std::string& file) {
  return std::filesystem::path(file).extension().string();
}

// --- one signature for all formats ---

using Write = ExportedMap(const TagMap&, std::optional<FieldSize>);

Expected<ImportedMap> read_own_map(const std::string& text, const MapImportOptions& options,
                                   const std::string& context) {
  auto map = map_from_yaml(text, context);
  if (!map) return tl::unexpected<Error>(map.error());
  return with_family({std::move(*map), {}}, options, context);
}

/// Neither CSV nor WPILib names a family.
Expected<ImportedMap> without_family(Expected<TagMap> map, const MapImportOptions& options,
                                     const std::string& context) {
  if (!map) return tl::unexpected<Error>(map.error());
  map->family.clear();
  return checked_import({std::move(*map), {}}, options, context);
}

Expected<ImportedMap> read_csv(const std::string& text, const MapImportOptions& options,
                               const std::string& context) {
  return without_family(map_from_csv(text, context), options, context);
}

Expected<ImportedMap> read_wpilib(const std::string& text, const MapImportOptions& options,
                                  const std::string& context) {
  if (!options.edge_m)
    return fail(ErrorCode::kInvalid,
                "WPILib files do not contain the size of the tags; add --tag-size METRES", context);
  auto imported =
      without_family(map_from_wpilib_json(text, *options.edge_m, context), options, context);
  if (!imported) return imported;
  imported->remarks.push_back("the file has no sizes: all tags are " + shortest(*options.edge_m) +
                              " m; length and width of the field are not kept");
  std::ranges::move(field_remarks(imported->map), std::back_inserter(imported->remarks));
  return imported;
}

Expected<ImportedMap> read_limelight(const std::string& text, const MapImportOptions& options,
                                     const std::string& context) {
  auto imported = map_from_limelight_json(text, context);
  if (!imported) return imported;
  return checked_import(std::move(*imported), options, context);
}

template <ExportedMap (*write)(const TagMap&)>
ExportedMap write_as(const TagMap& map, std::optional<FieldSize> /*field*/) {
  return write(map);
}

template <std::string (*write)(const TagMap&)>
ExportedMap write_whole(const TagMap& map, std::optional<FieldSize> /*field*/) {
  return {write(map), {}};
}

struct FormatEntry {
  MapFormat format;
  std::string_view name;
  bool takes_edge;  ///< The file has no sizes, or none in metres.
  MapReader* read;
  Write* write;
};
constexpr std::array<FormatEntry, 8> kMapFormats{{
    {MapFormat::kFiducap, "fiducap", false, read_own_map, write_whole<map_to_yaml>},
    {MapFormat::kCsv, "csv", false, read_csv, write_whole<map_to_csv>},
    {MapFormat::kTagslam, "tagslam", false, map_from_tagslam_yaml, write_as<map_to_tagslam_yaml>},
    {MapFormat::kBundles, "apriltag_ros", false, map_from_bundle_yaml,
     write_as<map_to_bundle_yaml>},
    {MapFormat::kRcars, "rcars", true, map_from_rcars_yaml, write_as<map_to_rcars_yaml>},
    {MapFormat::kAruco, "aruco", true, map_from_aruco_yaml, write_as<map_to_aruco_yaml>},
    {MapFormat::kWpilib, "wpilib", true, read_wpilib, map_to_wpilib_json},
    {MapFormat::kLimelight, "limelight", false, read_limelight, map_to_limelight_json},
}};

/// In the order of MapFormat.
const FormatEntry& entry_of(MapFormat format) {
  return kMapFormats[static_cast<std::size_t>(format)];
}

}  // namespace

std::string_view name_of(MapFormat format) { return entry_of(format).name; }

std::optional<MapFormat> map_format_from(std::string_view name) {
  for (const FormatEntry& entry : kMapFormats)
    if (entry.name == name) return entry.format;
  return std::nullopt;
}

std::string map_format_names() {
  return comma_list(kMapFormats, [](const FormatEntry& entry) { return entry.name; });
}

Expected<MapFormat> map_format_of(const std::string& file, std::string_view text) {
  if (const auto format = format_by_content(text)) return *format;
  const std::string end = end_of(file);
  if (end == ".csv") return MapFormat::kCsv;
  if (end == ".json") return MapFormat::kWpilib;
  return fail(
      ErrorCode::kUnsupported,
      "is a map of no known format, by its content (ids and sizes without places are none); "
      "name the format with --format: " +
          map_format_names(),
      file);
}

Expected<MapFormat> map_format_of(const std::string& file) {
  const std::string end = end_of(file);
  if (end == ".yaml" || end == ".yml") return MapFormat::kFiducap;
  if (end == ".csv") return MapFormat::kCsv;
  if (end == ".json") return MapFormat::kWpilib;
  if (end == ".fmap") return MapFormat::kLimelight;
  return fail(
      ErrorCode::kUnsupported,
      "maps are written as .yaml or .csv (ours), .json (WPILib) or .fmap (Limelight), not '" + end +
          "'; or name the format with --format: " + map_format_names(),
      file);
}

Expected<ImportedMap> read_map(MapFormat format, const std::string& text,
                               const MapImportOptions& options, const std::string& context) {
  if (options.edge_m) {
    if (const auto fault = unit_fault_of_edge(*options.edge_m))
      return fail(ErrorCode::kInvalid, "the given size: " + *fault, context);
  }
  auto imported = entry_of(format).read(text, options, context);
  if (imported && options.edge_m && !entry_of(format).takes_edge)
    imported->remarks.push_back("--tag-size is not used: the file contains the size of its tags");
  return imported;
}

ExportedMap write_map(MapFormat format, const TagMap& map, std::optional<FieldSize> field) {
  return entry_of(format).write(map, field);
}

}  // namespace fiducap
