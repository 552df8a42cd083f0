#include "mapping/formats/map_format.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>

#include "mapping/formats/map_doubts.hpp"
#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/map_yaml.hpp"
#include "mapping/formats/text_number.hpp"

namespace fiducap {

namespace {

struct FormatEntry {
  MapFormat format;
  std::string_view name;
};
constexpr std::array kMapFormats{
    FormatEntry{MapFormat::kFiducap, "fiducap"}, FormatEntry{MapFormat::kCsv, "csv"},
    FormatEntry{MapFormat::kTagslam, "tagslam"}, FormatEntry{MapFormat::kBundles, "apriltag_ros"},
    FormatEntry{MapFormat::kRcars, "rcars"},     FormatEntry{MapFormat::kAruco, "aruco"},
    FormatEntry{MapFormat::kWpilib, "wpilib"},
};

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

/// The first key at the beginning of a line that says what the text is.
std::optional<MapFormat> format_by_keys(std::string_view text) {
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    const std::string_view key = without_blanks(line.substr(0, line.find(':')));
    for (const TopKey& one : kTopKeys)
      if (key.size() < line.size() && key == one.key) return one.format;
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
  return std::nullopt;
}

std::optional<MapFormat> format_by_content(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  if (text.starts_with("id,")) return MapFormat::kCsv;
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first != std::string_view::npos && text[first] == '{')
    return text.find("fiducap-map") == std::string_view::npos ? MapFormat::kWpilib
                                                              : MapFormat::kFiducap;
  return format_by_keys(text);
}

std::string end_of(const std::string& file) {
  return std::filesystem::path(file).extension().string();
}

Expected<ImportedMap> surveyed(Expected<TagMap> map, const MapImportOptions& options,
                               const std::string& context) {
  if (!map) return tl::unexpected<Error>(map.error());
  ImportedMap imported{std::move(*map), {}};
  imported.map.family.clear();  // neither CSV nor WPILib says it
  if (auto fits = settle_family(imported, options, context); !fits)
    return tl::unexpected<Error>(fits.error());
  for (std::string& doubt : doubts_about(imported.map))
    imported.remarks.push_back(std::move(doubt));
  return imported;
}

Expected<ImportedMap> wpilib(const std::string& text, const MapImportOptions& options,
                             const std::string& context) {
  if (!options.edge_m) {
    return fail(ErrorCode::kInvalid,
                "WPILib files do not say how large the tags are; add --tag-size METRES", context);
  }
  auto imported = surveyed(map_from_wpilib_json(text, *options.edge_m, context), options, context);
  if (imported) {
    imported->remarks.push_back("the file has no sizes: all tags are " + to_text(*options.edge_m) +
                                " m; length and width of the field are not kept");
  }
  return imported;
}

bool takes_edge(MapFormat format) {
  return format == MapFormat::kRcars || format == MapFormat::kAruco || format == MapFormat::kWpilib;
}

Expected<ImportedMap> read_as(MapFormat format, const std::string& text,
                              const MapImportOptions& options, const std::string& context) {
  switch (format) {
    case MapFormat::kFiducap: {
      auto map = map_from_yaml(text, context);
      if (!map) return tl::unexpected<Error>(map.error());
      ImportedMap imported{std::move(*map), {}};
      if (auto fits = settle_family(imported, options, context); !fits)
        return tl::unexpected<Error>(fits.error());
      return imported;
    }
    case MapFormat::kCsv:
      return surveyed(map_from_csv(text, context), options, context);
    case MapFormat::kTagslam:
      return map_from_tagslam_yaml(text, options, context);
    case MapFormat::kBundles:
      return map_from_bundle_yaml(text, options, context);
    case MapFormat::kRcars:
      return map_from_rcars_yaml(text, options, context);
    case MapFormat::kAruco:
      return map_from_aruco_yaml(text, options, context);
    case MapFormat::kWpilib:
      return wpilib(text, options, context);
  }
  return fail(ErrorCode::kUnsupported, "unknown format", context);
}

}  // namespace

std::string_view name_of(MapFormat format) {
  for (const FormatEntry& entry : kMapFormats)
    if (entry.format == format) return entry.name;
  return "fiducap";
}

std::optional<MapFormat> map_format_from(std::string_view name) {
  for (const FormatEntry& entry : kMapFormats)
    if (entry.name == name) return entry.format;
  return std::nullopt;
}

std::string map_format_names() {
  std::string names;
  for (const FormatEntry& entry : kMapFormats)
    names += (names.empty() ? "" : ", ") + std::string(entry.name);
  return names;
}

Expected<MapFormat> map_format_of(const std::string& file, std::string_view text) {
  if (const auto format = format_by_content(text)) return *format;
  const std::string end = end_of(file);
  if (end == ".csv") return MapFormat::kCsv;
  if (end == ".json") return MapFormat::kWpilib;
  return fail(ErrorCode::kUnsupported,
              "is none of the maps known by what stands in them; say which with --format: " +
                  map_format_names(),
              file);
}

Expected<MapFormat> map_format_of(const std::string& file) {
  const std::string end = end_of(file);
  if (end == ".yaml" || end == ".yml") return MapFormat::kFiducap;
  if (end == ".csv") return MapFormat::kCsv;
  if (end == ".json") return MapFormat::kWpilib;
  return fail(ErrorCode::kUnsupported,
              "maps are written as .yaml or .csv (ours) or .json (WPILib), not '" + end +
                  "'; or say which with --format: " + map_format_names(),
              file);
}

Expected<ImportedMap> read_map(MapFormat format, const std::string& text,
                               const MapImportOptions& options, const std::string& context) {
  if (options.edge_m) {
    if (const auto fault = unit_fault_of_edge(*options.edge_m))
      return fail(ErrorCode::kInvalid, "the given size: " + *fault, context);
  }
  auto imported = read_as(format, text, options, context);
  if (imported && options.edge_m && !takes_edge(format))
    imported->remarks.push_back("--tag-size is not used: the file says how large its tags are");
  return imported;
}

ExportedMap write_map(MapFormat format, const TagMap& map, std::optional<FieldSize> field) {
  switch (format) {
    case MapFormat::kFiducap:
      return {map_to_yaml(map), {}};
    case MapFormat::kCsv:
      return {map_to_csv(map), {}};
    case MapFormat::kTagslam:
      return map_to_tagslam_yaml(map);
    case MapFormat::kBundles:
      return map_to_bundle_yaml(map);
    case MapFormat::kRcars:
      return map_to_rcars_yaml(map);
    case MapFormat::kAruco:
      return map_to_aruco_yaml(map);
    case MapFormat::kWpilib:
      return map_to_wpilib_json(map, field);
  }
  return {};
}

}  // namespace fiducap
