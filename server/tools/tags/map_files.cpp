#include "tools/tags/map_files.hpp"

#include <cmath>
#include <filesystem>
#include <sstream>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "daemon/system.hpp"

namespace fiducap {
namespace {

/// The newest undamaged version; skipped versions are reported.
Expected<TagMap> newest_of(const MapStore& store, const Terminal& terminal) {
  auto sound = store.newest_sound();
  if (!sound) return tl::unexpected(sound.error());
  for (const DamagedVersion& one : sound->damaged)
    terminal.err << "fiducap: passed over version " << one.version << ", it " << one.fault << "\n";
  return std::move(sound->map);
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::optional<MeasuredPlace> place_from(std::string_view line) {
  MeasuredPlace place;
  for (int column = 0; column < 4; ++column) {
    const auto comma = line.find(',');
    if ((comma == std::string_view::npos) != (column == 3)) return std::nullopt;
    const std::string_view field = trimmed(line.substr(0, comma));
    if (column == 0 ? !parse_number(field, place.tag_id)
                    : !parse_number(field, place.p_RT[column - 1]))
      return std::nullopt;
    line.remove_prefix(column == 3 ? line.size() : comma + 1);
  }
  if (place.tag_id < 0 || !place.p_RT.allFinite()) return std::nullopt;
  return place;
}

}  // namespace

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

Expected<MapStore> open_existing_store(const std::string& path) {
  if (!std::filesystem::exists(path))
    return fail(
        ErrorCode::kNotFound,
        "no such map store; fiducapd makes it at map.store, or fill one with fiducap map import",
        path);
  return MapStore::open_to_read(path);
}

Expected<TagMap> version_of(const MapStore& store, std::optional<std::int64_t> version,
                            const Terminal& terminal) {
  return version ? store.load(*version) : newest_of(store, terminal);
}

Expected<TagMap> stored_version(const std::string& path, std::optional<std::int64_t> version,
                                const Terminal& terminal) {
  return open_existing_store(path).and_then(
      [&](const MapStore& store) { return version_of(store, version, terminal); });
}

Expected<TagMap> store_next_version(const std::string& path, TagMap map, const std::string& comment,
                                    const Terminal& terminal, MapOrigin origin) {
  auto store = MapStore::open(path);
  if (!store) return tl::unexpected(store.error());
  if (auto claimed = store->claim(); !claimed) return tl::unexpected(claimed.error());
  const auto newest = newest_of(*store, terminal);
  if (!newest) return tl::unexpected(newest.error());
  if (origin == MapOrigin::kFile) map.version = newest->version;
  if (map.created_utc_ns == 0 || origin == MapOrigin::kStore) map.created_utc_ns = utc_now_ns();
  return store->commit(map, comment);
}

std::pair<double, double> largest_sigmas(const KnownTag& tag) {
  const auto variances = tag.covariance.diagonal();
  return {std::sqrt(variances.head<3>().maxCoeff()), std::sqrt(variances.tail<3>().maxCoeff())};
}

Expected<std::vector<MeasuredPlace>> read_measured_places(const std::string& file) {
  const auto text = read_whole_file(file);
  if (!text) return tl::unexpected(text.error());
  std::vector<MeasuredPlace> places;
  std::istringstream lines(*text);
  bool has_header = false;
  int number = 0;
  for (std::string whole; std::getline(lines, whole);) {
    ++number;
    const std::string_view line = trimmed(whole);
    if (line.empty() || line.front() == '#') continue;
    const std::string where = file + ":" + std::to_string(number);
    if (!has_header) {
      if (line != "id,x,y,z")
        return fail(ErrorCode::kInvalid,
                    "expected the header id,x,y,z, got '" + std::string(line) + "'", where);
      has_header = true;
      continue;
    }
    const auto place = place_from(line);
    if (!place)
      return fail(
          ErrorCode::kInvalid,
          "expected a tag's id and its place, three numbers in metres (7,1.25,-0.4,2), got '" +
              std::string(line) + "'",
          where);
    places.push_back(*place);
  }
  if (!has_header)
    return fail(ErrorCode::kInvalid, "expected the header id,x,y,z, got nothing", file);
  return places;
}

void print_stored(const std::string& store, const TagMap& map, const Terminal& terminal) {
  terminal.out << store << ": version " << map.version << ", " << map.tags.size() << " tags, hash "
               << map.hash << "\n";
}

nlohmann::ordered_json version_json(const std::string& file, const TagMap& map) {
  return {{"file", file},         {"version", map.version},
          {"parent", map.parent}, {"tags", map.tags.size()},
          {"hash", map.hash},     {"comment", map.comment}};
}

}  // namespace fiducap
