#include "tools/map_verbs.hpp"

#include <CLI/CLI.hpp>

#include "detection/tag_family_list.hpp"
#include "mapping/formats/map_format.hpp"
#include "tools/positive_number.hpp"

namespace fiducap {
namespace {

struct MapLine {
  MapVerbs& verbs;
  ChosenVerb& chosen;
};

/// @param arguments  of all verbs that are like it
template <class Arguments>
CLI::App* add_store_verb(CLI::App& map, const MapLine& line, Arguments& arguments, const char* name,
                         const char* what, const char* store, const std::string& footer,
                         int (*run)(const Arguments&, const Terminal&)) {
  auto* verb = map.add_subcommand(name, what);
  verb->add_option("--store", arguments.store, store)->required();
  verb->add_flag("--json", arguments.json, "One JSON object for scripts");
  verb->footer(footer);
  verb->callback([line, &arguments, run] {
    line.chosen = [&arguments, run](const Terminal& t) { return run(arguments, t); };
  });
  return verb;
}

CLI::App* add_map_verb(CLI::App& map, const MapLine& line, const char* name, const char* what,
                       const char* example, int (*run)(const MapArguments&, const Terminal&)) {
  return add_store_verb(map, line, line.verbs.store, name, what,
                        "The map store, as map.store of the server's configuration says",
                        std::string("Example:\n  fiducap map ") + example, run);
}

void add_map_format(CLI::App& verb, MapArguments& a, const std::string& what) {
  verb.add_option("--format", a.format, what + "; one of " + map_format_names())
      ->check(CLI::Validator(
          [](std::string& name) {
            return map_format_from(name) ? std::string() : "must be one of " + map_format_names();
          },
          "NAME"));
}

void add_map_export(CLI::App& map, const MapLine& line) {
  auto& a = line.verbs.store;
  auto* take = add_map_verb(map, line, "export",
                            "Write one version to a file: ours (.yaml, complete), or another "
                            "program's",
                            "export --store hall.map hall.yaml\n"
                            "  fiducap map export --store hall.map tagslam.yaml --format tagslam\n"
                            "  fiducap map export --store hall.map field.json --field 16.54 8.21",
                            run_map_export);
  take->add_option("FILE", a.file, "Where to")->required();
  add_map_format(*take, a,
                 "What to write; when not given, by the end of the name: .yaml and .csv are ours, "
                 ".json WPILib's");
  take->add_option(
          "--field", a.field_m,
          "Length and width of the playing field in metres, for WPILib; as far as the tags "
          "reach when not given")
      ->expected(2)
      ->check(kPositive);
  take->add_option("--version", a.version, "Which version; the newest when not given");
}

void add_map_build(CLI::App& map, const MapLine& line) {
  auto& a = line.verbs.build;
  auto* verb = map.add_subcommand(
      "build", "One map out of recordings: of several robots, of several days, solved as one");
  verb->add_option("RECORDING", a.recordings,
                   "Folders in the EuRoC/ASL layout. Those that have no time in common come one "
                   "after the other, as they are given")
      ->required();
  verb->add_option("--out", a.out, "Write the map to this file: .yaml (complete), .csv");
  verb->add_option("--store", a.store,
                   "Store it as the next version, as map.store of the server's configuration says");
  verb->add_option("--config", a.config,
                   "Take the sections estimator, detector, tags and map of a server configuration");
  verb->add_option("--map", a.map,
                   "Tags whose places are known (a survey, an earlier map): they stay as they are. "
                   ".yaml, .csv");
  verb->add_option("--filter", a.filter, "Which filter")
      ->check(CLI::IsMember({"robocentric", "world"}));
  verb->add_option("--set", a.sets,
                   "Override one key of the configuration; may be given several times")
      ->allow_extra_args(false);
  verb->add_option("--comment", a.comment, "What the history shall say about it");
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Fails when no recording has given the map a tag.\n"
      "Example:\n"
      "  fiducap map build monday/drone monday/rover friday/drone --out hall.yaml\n"
      "  fiducap map build friday/drone --map surveyed.csv --store hall.map");
  verb->callback([line] {
    line.chosen = [&a = line.verbs.build](const Terminal& t) { return run_map_build(a, t); };
  });
}

CLI::App* add_edit_verb(CLI::App& map, const MapLine& line, const char* name, const char* what,
                        const char* example, int (*run)(const MapEditArguments&, const Terminal&)) {
  return add_store_verb(
      map, line, line.verbs.edit, name, what,
      "The map store; no server may have it open (fiducap control does it there)",
      std::string("The map of before stays in the store.\nExample:\n") + "  fiducap map " + example,
      run);
}

void add_map_align(CLI::App& map, const MapLine& line) {
  auto& a = line.verbs.edit;
  auto* verb = add_edit_verb(map, line, "align",
                             "Say where the workspace lies in the room, by measured tags: yaw and "
                             "shift, least squares",
                             "align --store hall.map --to measured.csv\n"
                             "  fiducap map align --store hall.map --distance 3 17 4.52",
                             run_map_align);
  auto* to = verb->add_option("--to", a.measured,
                              "Middles of three tags or more as measured in the room: CSV with the "
                              "header id,x,y,z, metres, z up");
  verb->add_option("--tolerance", a.most_off_m,
                   "What a measured place may be off, metres: beyond it contradicts the others")
      ->check(kPositive)
      ->capture_default_str();
  verb->add_option("--distance", a.distance,
                   "Two tags and the metres between their middles by a tape: compared with the "
                   "map, which is not scaled")
      ->expected(3)
      ->excludes(to);
  verb->add_option("--comment", a.comment, "What the history shall say about it");
}

void add_map_edit(CLI::App& map, const MapLine& line) {
  auto& a = line.verbs.edit;
  auto* verb = add_edit_verb(map, line, "edit", "Forget, quarantine or survey tags",
                             "edit --store hall.map --forget 7\n"
                             "  fiducap map edit --store hall.map --survey 3 1.25 4 1.6 --sigma "
                             "0.002",
                             run_map_edit);
  verb->add_option("--forget", a.forget, "Ids of tags that go: seen again, they are new ones");
  verb->add_option("--quarantine", a.quarantine, "Ids of tags that are kept and not used");
  verb->add_option("--survey", a.survey,
                   "Id, measured place x y z of its middle in the workspace (metres), and, when "
                   "the map is to take it over, the attitude w x y z")
      ->expected(4, 8);
  verb->add_option("--sigma", a.sigma_m, "1-sigma of each coordinate of the survey, metres")
      ->check(kPositive);
  verb->add_option("--tag-size", a.tag_size_m, "Edge of a surveyed tag that is new, metres")
      ->check(kPositive);
  verb->add_option("--comment", a.comment, "What the history shall say about it");
}

void add_map_history(CLI::App& map, const MapLine& line) {
  auto& a = line.verbs.edit;
  add_edit_verb(map, line, "rollback", "Store an older version again, as the newest one",
                "rollback --store hall.map 12", run_map_rollback)
      ->add_option("VERSION", a.version, "Its number, as the log says")
      ->required();
  auto* name = add_edit_verb(map, line, "name", "Name a version: it is never thinned out then",
                             "name --store hall.map 12 \"before the move\"", run_map_name);
  name->add_option("VERSION", a.version, "Its number, as the log says")->required();
  name->add_option("NAME", a.name, "1 to 200 characters; the log shows it as comment")->required();
}

}  // namespace

void add_map(CLI::App& app, MapVerbs& verbs, ChosenVerb& chosen) {
  const MapLine line{verbs, chosen};
  auto* map = app.add_subcommand(
      "map", "Build tag maps, look into their store, change them, take them out, put them in");
  map->require_subcommand(1);
  map->footer("Example:\n  fiducap map log --store hall.map");
  auto& a = line.verbs.store;
  add_map_build(*map, line);
  add_map_export(*map, line);
  auto* put = add_map_verb(*map, line, "import",
                           "Store a file as the next version: ours, or another program's",
                           "import --store hall.map field.json --tag-size 0.1651\n"
                           "  fiducap map import --store hall.map poses.yaml\n"
                           "  fiducap map import --store hall.map tags.yaml --format apriltag_ros\n"
                           "  fiducap map import --store hall.map default.yaml --tag-size 0.16",
                           run_map_import);
  put->add_option("FILE", a.file, "Where from")->required();
  add_map_format(*put, a, "What the file is; when not given, what stands in it says");
  put->add_option(
         "--tag-size", a.tag_size_m,
         "Edge of the tags in metres, where the file does not say it: WPILib, RCARS, ArUco "
         "in pixels")
      ->check(kPositive);
  put->add_option("--family", a.family,
                  "Family of the tags, where the file does not say it; tag36h11 when not given")
      ->check(CLI::Validator(
          [](std::string& name) {
            if (!is_tag_family(name)) return tag_family_rule(name);
            name = listed_tag_family(name);
            return std::string();
          },
          "NAME"));
  put->add_option("--comment", a.comment, "What the history shall say about it");
  add_map_verb(*map, line, "log", "All versions, newest first", "log --store hall.map --json",
               run_map_log);
  auto* diff =
      add_map_verb(*map, line, "diff", "How far tags moved between two versions, in mm and degrees",
                   "diff --store hall.map --from 3 --to 7", run_map_diff);
  diff->add_option("--from", a.before, "The older version; the parent of --to when not given");
  diff->add_option("--to", a.after, "The newer version; the newest when not given");
  auto* show = add_map_verb(*map, line, "show", "The tags of one version",
                            "show --store hall.map --version 3", run_map_show);
  show->add_option("--version", a.version, "Which version; the newest when not given");
  add_map_history(*map, line);
  add_map_align(*map, line);
  add_map_edit(*map, line);
  add_map_verb(*map, line, "check", "Is every version as it was stored? Changes nothing",
               "check --store hall.map", run_map_check);
  add_map_verb(*map, line, "repair",
               "Make a store of what is sound in a damaged one, which is kept beside it",
               "repair --store hall.map", run_map_repair);
}

}  // namespace fiducap
