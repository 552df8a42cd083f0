#include "tools/tags/map_file.hpp"

#include <utility>

#include "base/whole_file.hpp"
#include "mapping/formats/map_yaml.hpp"

namespace fiducap {

Expected<ImportedMap> import_map_file(const std::string& path, std::optional<MapFormat> format,
                                      const MapImportOptions& options) {
  const auto text = read_whole_file(path);
  if (!text) return tl::unexpected(text.error());
  if (!format) {
    const auto recognised = map_format_of(path, *text);
    if (!recognised) return tl::unexpected(recognised.error());
    format = *recognised;
  }
  return read_map(*format, *text, options, path);
}

Expected<TagMap> read_map_file(const std::string& path) {
  const auto text = read_whole_file(path);
  if (!text) return tl::unexpected(text.error());
  const auto format = map_format_of(path, *text);
  if (!format) return tl::unexpected(format.error());
  if (*format == MapFormat::kFiducap) return map_from_yaml(*text, path);
  if (*format == MapFormat::kCsv) return map_from_csv(*text, path);
  return fail(ErrorCode::kUnsupported,
              "is a map of the format " + std::string(name_of(*format)) +
                  ", here must be one of ours (.yaml, .csv); fiducap map import takes it, and "
                  "fiducap map export makes one of ours",
              path);
}

Expected<std::vector<std::string>> write_map_file(const std::string& path, const TagMap& map,
                                                  std::optional<MapFormat> format,
                                                  std::optional<FieldSize> field) {
  if (!format) {
    const auto named = map_format_of(path);
    if (!named) return tl::unexpected(named.error());
    format = *named;
  }
  ExportedMap exported = write_map(*format, map, field);
  if (auto written = write_whole_file(path, exported.text); !written)
    return tl::unexpected(written.error());
  return std::move(exported.remarks);
}

}  // namespace fiducap
