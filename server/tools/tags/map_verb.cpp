#include <filesystem>
#include <optional>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "daemon/system.hpp"
#include "detection/tag_family.hpp"
#include "mapping/store/map_repair.hpp"
#include "tools/tags/map_files.hpp"
#include "tools/tags/tag_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

std::string utc_text(std::int64_t utc_ns) {
  return fmt::format("{:%Y-%m-%d %H:%M:%SZ}", fmt::gmtime(utc_ns / 1'000'000'000));
}

/// nullopt: not given. The command line took no other name.
std::optional<MapFormat> format_of(const MapArguments& arguments) {
  return map_format_from(arguments.format);
}

void print_remarks(const Terminal& terminal, const std::string& file,
                   const std::vector<std::string>& remarks) {
  for (const std::string& one : remarks) terminal.err << file << ": " << one << "\n";
}

nlohmann::ordered_json map_json(const TagMap& map) {
  nlohmann::ordered_json json{{"version", map.version}, {"parent", map.parent},
                              {"hash", map.hash},       {"family", map.family},
                              {"comment", map.comment}, {"tags", nlohmann::ordered_json::array()}};
  for (const MapTag& entry : map.tags) {
    const auto& [q, p] = entry.tag.X_WT;
    const auto [position, rotation] = largest_sigmas(entry.tag);
    json["tags"].push_back({{"id", entry.tag.tag_id},
                            {"edge_m", entry.tag.edge_m},
                            {"position_m", {p.x(), p.y(), p.z()}},
                            {"orientation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                            {"position_sigma_m", position},
                            {"rotation_sigma_rad", rotation},
                            {"state", name_of(entry.state)},
                            {"sightings", entry.sightings}});
  }
  return json;
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
    const auto [position, rotation] = largest_sigmas(entry.tag);
    out << fmt::format(
        "{:5} {:7.4f} {:8.4f} {:8.4f} {:8.4f} {:7.4f} {:7.4f} {:7.4f} {:7.4f} {:6.2f} {:6.3f} "
        "{:<11} {:9}\n",
        entry.tag.tag_id, entry.tag.edge_m, p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z(),
        1000 * position, kDegreesPerRadian * rotation, name_of(entry.state), entry.sightings);
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

void add_version(const MapVerb& to) {
  to.verb.add_option("--version", to.arguments.version, "Which version; the newest when not given");
}

void add_format(const MapVerb& to, const std::string& what) {
  to.verb.add_option("--format", to.arguments.format, what + "; one of " + map_format_names())
      ->check(CLI::Validator(
          [](std::string& name) {
            return map_format_from(name) ? std::string() : "must be one of " + map_format_names();
          },
          "NAME"));
}

void add_export(CLI::App& map, ChosenVerb& chosen) {
  const MapVerb added = add_map_verb(
      map, chosen, "export",
      "Write one version to a file: ours (.yaml, complete), or another program's", false,
      "export --store hall.map hall.yaml\n"
      "  fiducap map export --store hall.map tagslam.yaml --format tagslam\n"
      "  fiducap map export --store hall.map field.json --field 16.54 8.21",
      run_map_export);
  auto& [verb, a] = added;
  verb.add_option("FILE", a.file, "Where to")->required();
  add_format(added,
             "What to write; when not given, by the end of the name: .yaml and .csv are ours, "
             ".json WPILib's");
  verb.add_option("--field", a.field_m,
                  "Length and width of the playing field in metres, for WPILib; as far as the tags "
                  "reach when not given")
      ->expected(2)
      ->check(kPositive);
  add_version(added);
}

void add_map_import(CLI::App& map, ChosenVerb& chosen) {
  const MapVerb added = add_map_verb(
      map, chosen, "import", "Store a file as the next version: ours, or another program's", false,
      "import --store hall.map field.json --tag-size 0.1651\n"
      "  fiducap map import --store hall.map poses.yaml\n"
      "  fiducap map import --store hall.map tags.yaml --format apriltag_ros\n"
      "  fiducap map import --store hall.map default.yaml --tag-size 0.16",
      run_map_import);
  auto& [verb, a] = added;
  verb.add_option("FILE", a.file, "Where from")->required();
  add_format(added, "What the file is; when not given, by its content");
  verb.add_option("--tag-size", a.tag_size_m,
                  "Edge of the tags in metres, where the file does not have it: WPILib, RCARS, "
                  "ArUco in pixels")
      ->check(kPositive);
  verb.add_option("--family", a.family,
                  "Family of the tags, where the file does not have it; tag36h11 when not given")
      ->check(CLI::Validator(
          [](std::string& name) {
            if (!is_tag_family(name)) return tag_family_rule(name);
            name = listed_tag_family(name);
            return std::string();
          },
          "NAME"));
  verb.add_option("--comment", a.comment, "Comment in the history");
}

void add_reading(CLI::App& map, ChosenVerb& chosen) {
  add_map_verb(map, chosen, "log", "All versions, newest first", false,
               "log --store hall.map --json", run_map_log);
  const auto& [diff, a] = add_map_verb(
      map, chosen, "diff", "How far tags moved between two versions, in mm and degrees", false,
      "diff --store hall.map --from 3 --to 7", run_map_diff);
  diff.add_option("--from", a.before, "The older version; the parent of --to when not given");
  diff.add_option("--to", a.after, "The newer version; the newest when not given");
  add_version(add_map_verb(map, chosen, "show", "The tags of one version", false,
                           "show --store hall.map --version 3", run_map_show));
}

}  // namespace

MapVerb add_map_verb(CLI::App& map, ChosenVerb& chosen, const char* name, const char* what,
                     bool changes, const std::string& example,
                     int (*run)(const MapArguments&, const Terminal&)) {
  CLI::App& verb = *map.add_subcommand(name, what);
  auto& a = arguments_of<MapArguments>(verb, chosen, run);
  verb.add_option("--store", a.store,
                  changes ? "The map store; no server may have it open (fiducap control does it "
                            "there)"
                          : "The map store: map.store of the server's configuration")
      ->required();
  verb.add_flag("--json", a.json, "One JSON object for scripts");
  verb.footer((changes ? "Earlier versions stay in the store.\n" : "") +
              ("Example:\n  fiducap map " + example));
  return {verb, a};
}

int run_map_export(const MapArguments& arguments, const Terminal& terminal) {
  const auto map = stored_version(arguments.store, arguments.version, terminal);
  if (!map) return report(terminal, map.error());
  std::optional<FieldSize> field;
  if (arguments.field_m.size() == 2) field = {arguments.field_m[0], arguments.field_m[1]};
  const auto remarks = write_map_file(arguments.file, *map, format_of(arguments), field);
  if (!remarks) return report(terminal, remarks.error());
  print_remarks(terminal, arguments.file, *remarks);
  if (arguments.json) return print_json(terminal, version_json(arguments.file, *map));
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
  if (arguments.json) return print_json(terminal, version_json(arguments.store, *stored));
  print_stored(arguments.store, *stored, terminal);
  return kExitOk;
}

int run_map_log(const MapArguments& arguments, const Terminal& terminal) {
  const auto store = open_existing_store(arguments.store);
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
    return print_json(terminal, json);
  }
  terminal.out << "version parent tags created              hash         comment\n";
  for (const MapVersionInfo& v : *log)
    terminal.out << fmt::format("{:7} {:6} {:4} {:<20} {:<12.12} {}\n", v.version, v.parent, v.tags,
                                utc_text(v.created_utc_ns), v.hash, v.comment);
  return kExitOk;
}

int run_map_diff(const MapArguments& arguments, const Terminal& terminal) {
  const auto store = open_existing_store(arguments.store);
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
    return print_json(terminal, json);
  }
  terminal.out << "version " << versions->first.version << " -> " << versions->second.version
               << ": "
               << (changes.empty() ? "no tag differs"
                                   : std::to_string(changes.size()) + " tags differ")
               << "\n";
  for (const TagChange& c : changes)
    terminal.out << (c.kind == TagChange::Kind::kMoved
                         ? fmt::format("{:5} moved   {:9.3f} mm {:8.4f} deg\n", c.tag_id,
                                       c.distance_mm, c.angle_deg)
                         : fmt::format("{:5} {}\n", c.tag_id, name_of(c.kind)));
  return kExitOk;
}

int run_map_show(const MapArguments& arguments, const Terminal& terminal) {
  const auto map = stored_version(arguments.store, arguments.version, terminal);
  if (!map) return report(terminal, map.error());
  if (arguments.json) return print_json(terminal, map_json(*map));
  print_map(terminal.out, *map);
  return kExitOk;
}

int run_map_check(const MapArguments& arguments, const Terminal& terminal) {
  const auto health = check_map_store(arguments.store);
  if (!health) return report(terminal, health.error());
  if (arguments.json) {
    print_json(terminal, health_json(arguments.store, *health));
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
    return print_json(terminal, json);
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

int run_map_backup(const MapArguments& arguments, const Terminal& terminal) {
  std::error_code error;
  if (!arguments.replaces && std::filesystem::exists(arguments.file, error))
    return report(terminal,
                  {ErrorCode::kInvalid, "is there already: name another file, or add --replace",
                   arguments.file});
  if (std::filesystem::equivalent(arguments.store, arguments.file, error))
    return report(terminal, {ErrorCode::kInvalid, "is the store itself", arguments.file});
  const auto backup = MapStore::back_up(arguments.store, arguments.file);
  if (!backup) return report(terminal, backup.error());
  for (const DamagedVersion& one : backup->damaged)
    terminal.err << arguments.store << ": version " << one.version << ' ' << one.fault << "\n";
  terminal.out << arguments.file << ": " << backup->versions
               << " versions, the newest sound one is " << backup->newest << "\n";
  return backup->damaged.empty() ? kExitOk : kExitFailed;
}

void add_map(CLI::App& app, ChosenVerb& chosen) {
  auto* map =
      app.add_subcommand("map", "Build tag maps; read, change, import and export those of a store");
  map->require_subcommand(1);
  map->footer("Example:\n  fiducap map log --store hall.map");
  add_map_build(*map, chosen);
  add_export(*map, chosen);
  add_map_import(*map, chosen);
  add_reading(*map, chosen);
  add_map_edits(*map, chosen);
  add_map_verb(*map, chosen, "check", "Is every version as it was stored? Changes nothing", false,
               "check --store hall.map", run_map_check);
  add_map_verb(*map, chosen, "repair",
               "Make a store of the undamaged versions; the damaged store is kept beside it", false,
               "repair --store hall.map", run_map_repair);
  const MapVerb backup =
      add_map_verb(*map, chosen, "backup", "Copy the store, also while a server writes to it",
                   false, "backup --store hall.map --out hall-backup.map", run_map_backup);
  backup.verb.add_option("--out", backup.arguments.file, "The copy")->required();
  backup.verb.add_flag("--replace", backup.arguments.replaces, "Replace an existing copy");
}

}  // namespace fiducap
