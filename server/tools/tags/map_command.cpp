#include "tools/tags/map_command.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <numbers>
#include <optional>

#include <nlohmann/json.hpp>

#include "daemon/system_clock.hpp"
#include "mapping/store/map_repair.hpp"
#include "mapping/store/map_store.hpp"
#include "tools/tags/map_file.hpp"

namespace fiducap {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

/// Reading must not leave an empty store behind when the name was wrong.
Expected<MapStore> open_existing(const std::string& path) {
  if (!std::filesystem::exists(path))
    return fail(ErrorCode::kNotFound,
                "no such map store; fiducapd makes it where map.store says, or fill one with "
                "fiducap map import",
                path);
  return MapStore::open_to_read(path);
}

/// The newest that is as it was stored; says what it passed over.
Expected<TagMap> newest_of(const MapStore& store, const Terminal& terminal) {
  auto sound = store.newest_sound();
  if (!sound) return tl::unexpected(sound.error());
  for (const DamagedVersion& one : sound->damaged)
    terminal.err << "fiducap: passed over version " << one.version << ", it " << one.fault << "\n";
  return std::move(sound->map);
}

Expected<TagMap> version_of(const MapStore& store, std::optional<std::int64_t> version,
                            const Terminal& terminal) {
  return version ? store.load(*version) : newest_of(store, terminal);
}

std::string utc_text(std::int64_t utc_ns) {
  const std::time_t seconds = utc_ns / 1'000'000'000;
  std::tm parts{};
  std::array<char, 32> text{};
  if (::gmtime_r(&seconds, &parts) == nullptr) return "?";
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%SZ", &parts);
  return text.data();
}

/// nullopt: not given. The command line took no other name.
std::optional<MapFormat> format_of(const MapArguments& arguments) {
  return map_format_from(arguments.format);
}

void print_remarks(const Terminal& terminal, const std::string& file,
                   const std::vector<std::string>& remarks) {
  for (const std::string& one : remarks) terminal.err << file << ": " << one << "\n";
}

/// Largest 1-sigma along an axis, position in metres and attitude in radians.
std::pair<double, double> sigmas(const KnownTag& tag) {
  const auto variances = tag.covariance.diagonal();
  return {std::sqrt(variances.head<3>().maxCoeff()), std::sqrt(variances.tail<3>().maxCoeff())};
}

std::string map_json(const TagMap& map) {
  nlohmann::ordered_json json{{"version", map.version}, {"parent", map.parent},
                              {"hash", map.hash},       {"family", map.family},
                              {"comment", map.comment}, {"tags", nlohmann::ordered_json::array()}};
  for (const MapTag& entry : map.tags) {
    const auto& [q, p] = entry.tag.X_WT;
    const auto [position, rotation] = sigmas(entry.tag);
    json["tags"].push_back({{"id", entry.tag.tag_id},
                            {"edge_m", entry.tag.edge_m},
                            {"position_m", {p.x(), p.y(), p.z()}},
                            {"orientation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                            {"position_sigma_m", position},
                            {"rotation_sigma_rad", rotation},
                            {"state", name_of(entry.state)},
                            {"sightings", entry.sightings}});
  }
  return json.dump(2) + "\n";
}

nlohmann::ordered_json health_json(const std::string& store, const MapStoreHealth& health) {
  return {{"file", store},
          {"sound", health.is_sound()},
          {"versions", health.sound},
          {"faults", health.sentences()}};
}

void print_map(std::ostream& out, const TagMap& map) {
  out << "version " << map.version << ", " << map.family << ", " << map.tags.size() << " tags, "
      << utc_text(map.created_utc_ns) << (map.comment.empty() ? "" : ", ") << map.comment << "\n"
      << "   id size[m]    x [m]    y [m]    z [m]      qw      qx      qy      qz 1s[mm]  1s[d] "
         "state       sightings\n";
  for (const MapTag& entry : map.tags) {
    const auto& [q, p] = entry.tag.X_WT;
    const auto [position, rotation] = sigmas(entry.tag);
    std::array<char, 256> line{};
    std::snprintf(line.data(), line.size(),
                  "%5d %7.4f %8.4f %8.4f %8.4f %7.4f %7.4f %7.4f %7.4f %6.2f %6.3f %-11s %9d\n",
                  entry.tag.tag_id, entry.tag.edge_m, p.x(), p.y(), p.z(), q.w(), q.x(), q.y(),
                  q.z(), 1000 * position, kDegrees * rotation,
                  std::string(name_of(entry.state)).c_str(), entry.sightings);
    out << line.data();
  }
}

Expected<std::pair<TagMap, TagMap>> two_versions(const MapStore& store,
                                                 const MapArguments& arguments,
                                                 const Terminal& terminal) {
  auto after = version_of(store, arguments.after, terminal);
  if (!after) return tl::unexpected(after.error());
  const std::int64_t before_version = arguments.before.value_or(after->parent);
  auto before = before_version == 0 ? Expected<TagMap>(TagMap{}) : store.load(before_version);
  if (!before) return tl::unexpected(before.error());
  return std::pair{std::move(*before), std::move(*after)};
}

}  // namespace

Expected<TagMap> store_next_version(const std::string& path, TagMap map, const std::string& comment,
                                    const Terminal& terminal, MapOrigin origin) {
  auto store = MapStore::open(path);
  if (!store) return tl::unexpected(store.error());
  if (auto claimed = store->claim(); !claimed) return tl::unexpected(claimed.error());
  const auto newest = newest_of(*store, terminal);
  if (!newest) return tl::unexpected(newest.error());
  // Whatever a file was once, here it follows the newest; a version of this store has a parent.
  if (origin == MapOrigin::kFile) map.version = newest->version;
  if (map.created_utc_ns == 0 || origin == MapOrigin::kStore) map.created_utc_ns = utc_now_ns();
  return store->commit(map, comment);
}

std::string version_json(const std::string& file, const TagMap& map) {
  const nlohmann::ordered_json json{{"file", file},         {"version", map.version},
                                    {"parent", map.parent}, {"tags", map.tags.size()},
                                    {"hash", map.hash},     {"comment", map.comment}};
  return json.dump(2) + "\n";
}

Expected<TagMap> stored_version(const std::string& path, std::optional<std::int64_t> version,
                                const Terminal& terminal) {
  const auto store = open_existing(path);
  if (!store) return tl::unexpected(store.error());
  return version_of(*store, version, terminal);
}

int run_map_export(const MapArguments& arguments, const Terminal& terminal) {
  const auto store = open_existing(arguments.store);
  if (!store) return report(terminal, store.error());
  const auto map = version_of(*store, arguments.version, terminal);
  if (!map) return report(terminal, map.error());
  std::optional<FieldSize> field;
  if (arguments.field_m.size() == 2) field = {arguments.field_m[0], arguments.field_m[1]};
  const auto remarks = write_map_file(arguments.file, *map, format_of(arguments), field);
  if (!remarks) return report(terminal, remarks.error());
  print_remarks(terminal, arguments.file, *remarks);
  if (arguments.json)
    terminal.out << version_json(arguments.file, *map);
  else
    terminal.out << arguments.file << ": version " << map->version << ", " << map->tags.size()
                 << " tags\n";
  return kExitOk;
}

int run_map_import(const MapArguments& arguments, const Terminal& terminal) {
  auto imported = import_map_file(arguments.file, format_of(arguments),
                                  {arguments.tag_size_m, arguments.family});
  if (!imported) return report(terminal, imported.error());
  print_remarks(terminal, arguments.file, imported->remarks);
  const std::string comment =
      arguments.comment.empty()
          ? "import of " + std::filesystem::path(arguments.file).filename().string()
          : arguments.comment;
  const auto stored =
      store_next_version(arguments.store, std::move(imported->map), comment, terminal);
  if (!stored) return report(terminal, stored.error());
  if (arguments.json)
    terminal.out << version_json(arguments.store, *stored);
  else
    terminal.out << arguments.store << ": version " << stored->version << ", "
                 << stored->tags.size() << " tags, hash " << stored->hash << "\n";
  return kExitOk;
}

int run_map_log(const MapArguments& arguments, const Terminal& terminal) {
  const auto store = open_existing(arguments.store);
  if (!store) return report(terminal, store.error());
  const auto log = store->log();
  if (!log) return report(terminal, log.error());
  if (arguments.json) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const MapVersionInfo& v : *log)
      json.push_back({{"version", v.version},
                      {"parent", v.parent},
                      {"created_utc_ns", v.created_utc_ns},
                      {"tags", v.tags},
                      {"hash", v.hash},
                      {"comment", v.comment}});
    terminal.out << json.dump(2) << "\n";
    return kExitOk;
  }
  terminal.out << "version parent tags created              hash         comment\n";
  for (const MapVersionInfo& v : *log) {
    std::array<char, 160> line{};
    std::snprintf(line.data(), line.size(), "%7lld %6lld %4d %-20s %-12.12s ",
                  static_cast<long long>(v.version), static_cast<long long>(v.parent), v.tags,
                  utc_text(v.created_utc_ns).c_str(), v.hash.c_str());
    terminal.out << line.data() << v.comment << "\n";
  }
  return kExitOk;
}

int run_map_diff(const MapArguments& arguments, const Terminal& terminal) {
  const auto store = open_existing(arguments.store);
  if (!store) return report(terminal, store.error());
  const auto versions = two_versions(*store, arguments, terminal);
  if (!versions) return report(terminal, versions.error());
  const auto changes = diff(versions->first, versions->second);
  if (arguments.json) {
    nlohmann::ordered_json json{{"before", versions->first.version},
                                {"after", versions->second.version},
                                {"changes", nlohmann::ordered_json::array()}};
    for (const TagChange& c : changes)
      json["changes"].push_back({{"id", c.tag_id},
                                 {"kind", name_of(c.kind)},
                                 {"distance_mm", c.distance_mm},
                                 {"angle_deg", c.angle_deg}});
    terminal.out << json.dump(2) << "\n";
    return kExitOk;
  }
  terminal.out << "version " << versions->first.version << " -> " << versions->second.version
               << ": "
               << (changes.empty() ? "no tag differs"
                                   : std::to_string(changes.size()) + " tags differ")
               << "\n";
  for (const TagChange& c : changes) {
    std::array<char, 96> line{};
    if (c.kind == TagChange::Kind::kMoved)
      std::snprintf(line.data(), line.size(), "%5d moved   %9.3f mm %8.4f deg\n", c.tag_id,
                    c.distance_mm, c.angle_deg);
    else
      std::snprintf(line.data(), line.size(), "%5d %s\n", c.tag_id,
                    std::string(name_of(c.kind)).c_str());
    terminal.out << line.data();
  }
  return kExitOk;
}

int run_map_show(const MapArguments& arguments, const Terminal& terminal) {
  const auto store = open_existing(arguments.store);
  if (!store) return report(terminal, store.error());
  const auto map = version_of(*store, arguments.version, terminal);
  if (!map) return report(terminal, map.error());
  if (arguments.json)
    terminal.out << map_json(*map);
  else
    print_map(terminal.out, *map);
  return kExitOk;
}

int run_map_check(const MapArguments& arguments, const Terminal& terminal) {
  const auto health = check_map_store(arguments.store);
  if (!health) return report(terminal, health.error());
  if (arguments.json) {
    terminal.out << health_json(arguments.store, *health).dump(2) << "\n";
    return health->is_sound() ? kExitOk : kExitFailed;
  }
  terminal.out << arguments.store << ": " << health->sound.size()
               << " versions are as they were stored"
               << (health->sound.empty() ? "" : ", the newest is ")
               << (health->sound.empty() ? "" : std::to_string(health->sound.back())) << "\n";
  for (const std::string& one : health->sentences()) terminal.out << "  !!  " << one << "\n";
  if (health->is_sound()) return kExitOk;
  terminal.out << "`fiducap map repair --store " << arguments.store
               << "` makes a store of what is sound and keeps this one aside\n";
  return kExitFailed;
}

int run_map_repair(const MapArguments& arguments, const Terminal& terminal) {
  const auto repair = repair_map_store(arguments.store);
  if (!repair) return report(terminal, repair.error());
  if (arguments.json) {
    auto json = health_json(arguments.store, repair->found);
    json["kept_as"] = repair->kept_as;
    terminal.out << json.dump(2) << "\n";
    return kExitOk;
  }
  if (repair->kept_as.empty() && repair->found.is_sound()) {
    terminal.out << arguments.store << ": is sound, nothing was changed\n";
    return kExitOk;
  }
  terminal.out << arguments.store << ": repaired, " << repair->found.sound.size()
               << " versions are there\n";
  for (const std::string& one : repair->found.sentences())
    terminal.out << "  !!  lost: " << one << "\n";
  if (!repair->kept_as.empty())
    terminal.out << "the damaged store is kept as " << repair->kept_as << "\n";
  return kExitOk;
}

}  // namespace fiducap
