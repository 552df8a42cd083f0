#include <cmath>
#include <filesystem>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "base/text.hpp"
#include "tools/tags/map_files.hpp"
#include "tools/tags/tag_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

int stored(const MapArguments& arguments, const Expected<TagMap>& map, const Terminal& terminal) {
  if (!map) return report(terminal, map.error());
  if (arguments.json) return print_json(terminal, version_json(arguments.store, *map));
  terminal.out << arguments.store << ": version " << map->version << ", " << map->tags.size()
               << " tags, parent " << map->parent << ", \"" << map->comment << "\"\n";
  return kExitOk;
}

int run_distance(const MapArguments& arguments, const Terminal& terminal) {
  const auto first = static_cast<int>(arguments.distance[0]);
  const auto second = static_cast<int>(arguments.distance[1]);
  const double tape_m = arguments.distance[2];
  if (first != arguments.distance[0] || second != arguments.distance[1] || first < 0 || second < 0)
    return report(terminal, Error{ErrorCode::kInvalid,
                                  "--distance needs two ids of tags and metres, as 3 17 4.52",
                                  {}});
  const auto map = stored_version(arguments.store, std::nullopt, terminal);
  if (!map) return report(terminal, map.error());
  const auto between = distance_between(*map, first, second);
  if (!between) return report(terminal, between.error());
  const double off_m = tape_m - between->distance_m;
  if (arguments.json)
    return print_json(terminal, {{"tags", {first, second}},
                                 {"tape_m", tape_m},
                                 {"map_m", between->distance_m},
                                 {"sigma_m", between->sigma_m},
                                 {"tape_less_map_m", off_m}});
  terminal.out << fmt::format(
                      "tags {} and {}: tape {:.4f} m, map {:.4f} m with sigma {:.1f} mm{}; tape "
                      "less map {:+.1f} mm, {:+.2f} per mille\n",
                      first, second, tape_m, between->distance_m, 1e3 * between->sigma_m,
                      between->is_correlated ? "" : " (what the errors of both share is not known)",
                      1e3 * off_m, 1e3 * off_m / between->distance_m)
               << "nothing was changed: a map is not scaled by a tape, its scale is that of the "
                  "printed tags; where they differ, measure the prints\n";
  return kExitOk;
}

/// Id, place, and the attitude when it is given.
Expected<SurveyedTag> survey_of(const MapArguments& arguments) {
  const auto& numbers = arguments.survey;
  if (numbers.size() != 4 && numbers.size() != 8)
    return fail(ErrorCode::kInvalid,
                "--survey needs an id and 3 numbers of the place, or 4 more of the attitude (w x "
                "y z); got " +
                    std::to_string(numbers.size()) + " numbers");
  if (numbers[0] < 0 || numbers[0] != std::floor(numbers[0]))
    return fail(ErrorCode::kInvalid, "--survey begins with the id of a tag, a whole number");
  SurveyedTag tag;
  tag.tag_id = static_cast<int>(numbers[0]);
  tag.p_WT = {numbers[1], numbers[2], numbers[3]};
  if (numbers.size() == 8) tag.q_WT = {numbers[4], numbers[5], numbers[6], numbers[7]};
  tag.sigma_m = arguments.sigma_m;
  tag.edge_m = arguments.tag_size_m.value_or(0);
  return tag;
}

void print_alignment(const MapAlignment& aligned, const Terminal& terminal) {
  terminal.out << "   id residual[mm]  x[mm]  y[mm]  z[mm]\n";
  for (const MapAlignment::Residual& one : aligned.residuals) {
    const Eigen::Vector3d off_mm = (1e4 * one.off_m).array().round() / 10 + 0.0;  // no -0.0
    terminal.out << fmt::format("{:5} {:12.1f} {:6.1f} {:6.1f} {:6.1f}\n", one.tag_id,
                                1e3 * one.off_m.norm(), off_mm.x(), off_mm.y(), off_mm.z());
  }
  const auto& [q, p] = aligned.X_RW;
  terminal.out << fmt::format(
      "the workspace lies at ({:.4f} {:.4f} {:.4f}) m in the room, turned by {:.3f} deg\n", p.x(),
      p.y(), p.z(), kDegreesPerRadian * log_so3(q).z());
}

nlohmann::ordered_json alignment_json(const MapAlignment& aligned, const std::string& store,
                                      const TagMap& map) {
  auto json = version_json(store, map);
  json["residuals"] = nlohmann::ordered_json::array();
  for (const MapAlignment::Residual& one : aligned.residuals)
    json["residuals"].push_back(
        {{"id", one.tag_id}, {"off_m", {one.off_m.x(), one.off_m.y(), one.off_m.z()}}});
  const auto& [q, p] = aligned.X_RW;
  json["workspace_in_room"] = {{"position_m", {p.x(), p.y(), p.z()}},
                               {"heading_deg", kDegreesPerRadian * log_so3(q).z()}};
  return json;
}

void add_align(CLI::App& map, ChosenVerb& chosen) {
  const auto& [verb, a] = add_map_verb(
      map, chosen, "align",
      "Align the workspace with the room by measured tags: yaw and shift, least squares", true,
      "align --store hall.map --to measured.csv\n"
      "  fiducap map align --store hall.map --distance 3 17 4.52",
      run_map_align);
  auto* to = verb.add_option("--to", a.measured,
                             "Centres of three tags or more as measured in the room: CSV with the "
                             "header id,x,y,z, metres, z up");
  add_positive(verb, "--tolerance", a.most_off_m,
               "Largest plausible error of a measured place, metres: beyond it contradicts the "
               "others");
  verb.add_option("--distance", a.distance,
                  "Two tags and the metres between their centres by a tape: compared with the "
                  "map, which is not scaled")
      ->expected(3)
      ->excludes(to);
  verb.add_option("--comment", a.comment, "Comment in the history");
}

void add_edit(CLI::App& map, ChosenVerb& chosen) {
  const auto& [verb, a] =
      add_map_verb(map, chosen, "edit", "Forget, quarantine or survey tags", true,
                   "edit --store hall.map --forget 7\n"
                   "  fiducap map edit --store hall.map --survey 3 1.25 4 1.6 --sigma 0.002",
                   run_map_edit);
  verb.add_option("--forget", a.forget, "Ids of tags to remove: seen again, they are new ones");
  verb.add_option("--quarantine", a.quarantine, "Ids of tags that are kept and not used");
  verb.add_option("--survey", a.survey,
                  "Id, measured place x y z of its centre in the workspace (metres), and, if the "
                  "map is to use it, the attitude w x y z")
      ->expected(4, 8);
  add_positive(verb, "--sigma", a.sigma_m, "1-sigma of each coordinate of the survey, metres");
  verb.add_option("--tag-size", a.tag_size_m, "Edge of a surveyed tag that is new, metres")
      ->check(kPositive);
  verb.add_option("--comment", a.comment, "Comment in the history");
}

}  // namespace

int run_map_rollback(const MapArguments& arguments, const Terminal& terminal) {
  const std::int64_t version = arguments.version.value_or(0);
  auto map = stored_version(arguments.store, version, terminal);
  if (!map) return report(terminal, map.error());
  return stored(arguments,
                store_next_version(arguments.store, std::move(*map),
                                   "rolled back to version " + std::to_string(version), terminal,
                                   MapOrigin::kStore),
                terminal);
}

int run_map_name(const MapArguments& arguments, const Terminal& terminal) {
  const std::int64_t version = arguments.version.value_or(0);  // the command line has one
  const auto there = stored_version(arguments.store, version, terminal);
  if (!there) return report(terminal, there.error());
  auto store = MapStore::open(arguments.store);
  if (!store) return report(terminal, store.error());
  if (const auto claimed = store->claim(); !claimed) return report(terminal, claimed.error());
  if (const auto named = store->name_version(version, arguments.name); !named)
    return report(terminal, named.error());
  if (arguments.json)
    return print_json(
        terminal, {{"file", arguments.store}, {"version", version}, {"comment", arguments.name}});
  terminal.out << arguments.store << ": version " << version << " is called \"" << arguments.name
               << "\"\n";
  return kExitOk;
}

int run_map_align(const MapArguments& arguments, const Terminal& terminal) {
  if (arguments.measured.empty() == arguments.distance.empty())
    return report(terminal,
                  Error{ErrorCode::kInvalid,
                        "needs either --to FILE with the measured places of three tags or more, or "
                        "--distance ID ID METRES to compare a tape with the map",
                        {}});
  if (!arguments.distance.empty()) return run_distance(arguments, terminal);
  const auto places = read_measured_places(arguments.measured);
  if (!places) return report(terminal, places.error());
  auto map = stored_version(arguments.store, std::nullopt, terminal);
  if (!map) return report(terminal, map.error());
  const auto aligned = align(*map, *places, arguments.most_off_m);
  if (!aligned)
    return report(terminal, Error{aligned.error().code, aligned.error().what, arguments.measured});
  if (!arguments.json) print_alignment(*aligned, terminal);
  map->X_RW = aligned->X_RW;
  const std::string comment =
      arguments.comment.empty()
          ? "aligned with " + std::filesystem::path(arguments.measured).filename().string()
          : arguments.comment;
  const auto next =
      store_next_version(arguments.store, std::move(*map), comment, terminal, MapOrigin::kStore);
  if (!next || !arguments.json) return stored(arguments, next, terminal);
  return print_json(terminal, alignment_json(*aligned, arguments.store, *next));
}

int run_map_edit(const MapArguments& arguments, const Terminal& terminal) {
  MapEdit edit{arguments.forget, arguments.quarantine, {}};
  if (!arguments.survey.empty()) {
    auto survey = survey_of(arguments);
    if (!survey) return report(terminal, survey.error());
    edit.survey = *survey;
  }
  const auto map = stored_version(arguments.store, std::nullopt, terminal);
  if (!map) return report(terminal, map.error());
  auto edited = edited_map(*map, edit);
  if (!edited) return report(terminal, edited.error());
  const std::string comment =
      arguments.comment.empty() ? "edited: " + words_of(edit) : arguments.comment;
  return stored(
      arguments,
      store_next_version(arguments.store, std::move(*edited), comment, terminal, MapOrigin::kStore),
      terminal);
}

void add_map_edits(CLI::App& map, ChosenVerb& chosen) {
  const auto& [back, a] =
      add_map_verb(map, chosen, "rollback", "Store an older version again, as the newest one", true,
                   "rollback --store hall.map 12", run_map_rollback);
  back.add_option("VERSION", a.version, "Its number, as in the log")->required();
  const auto& [name, b] =
      add_map_verb(map, chosen, "name", "Name a version: named versions are kept", true,
                   "name --store hall.map 12 \"before the move\"", run_map_name);
  name.add_option("VERSION", b.version, "Its number, as in the log")->required();
  name.add_option("NAME", b.name, "1 to 200 characters; the log shows it as comment")->required();
  add_align(map, chosen);
  add_edit(map, chosen);
}

}  // namespace fiducap
