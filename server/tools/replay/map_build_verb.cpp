#include <algorithm>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "daemon/system.hpp"
#include "tools/replay/replay_verbs.hpp"
#include "tools/tags/map_files.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

struct MapBuildArguments : SetupArguments {
  std::vector<std::string> recordings;
  std::string out;    ///< A file: .yaml, .csv; empty: none.
  std::string store;  ///< A map store; empty: none.
  std::string comment;
  bool json{false};
};

/// One map has one family, one reference tag, and one size for each tag.
Expected<void> check_same_tags(const ReplayInput& first, const ReplayInput& other) {
  const TagSetConfig& a = first.setup.tags;
  const TagSetConfig& b = other.setup.tags;
  const auto differs = [&](const std::string& what, const std::string& its, const std::string& was,
                           const std::string& remedy) {
    return fail(ErrorCode::kInvalid,
                what + " is " + its + " here and " + was + " in " + first.info.folder +
                    ": one map has one. " + remedy,
                other.info.folder);
  };
  if (a.family != b.family)
    return differs("the family of the tags", b.family, a.family,
                   "Make a map of each family, or correct it: --set tags.family=NAME");
  if (a.size_m != b.size_m)
    return differs("the size of the tags", fixed(b.size_m, 4) + " m", fixed(a.size_m, 4) + " m",
                   "Measure it (edge between black and white border): --set tags.size_m=METRES");
  for (const auto& [tag_id, size_m] : b.sizes_m) {
    const auto was = a.sizes_m.find(tag_id);
    if (was != a.sizes_m.end() && was->second != size_m)
      return differs("the size of tag " + std::to_string(tag_id), fixed(size_m, 4) + " m",
                     fixed(was->second, 4) + " m",
                     "Measure it: --set tags.sizes_m." + std::to_string(tag_id) + "=METRES");
  }
  const auto& before = first.setup.gauge.reference_tag;
  const auto& here = other.setup.gauge.reference_tag;
  if (before && here && *before != *here)
    return differs("the reference tag", std::to_string(*here), std::to_string(*before),
                   "Name one: --set map.reference_tag=N");
  return {};
}

Expected<ReplayInput> read_input(const MapBuildArguments& arguments, const std::string& folder,
                                 const Terminal& terminal) {
  auto info = read_recording_info(folder);
  if (!info) return tl::unexpected(info.error());
  const auto checked = require_usable(*info, terminal);
  if (!checked) return tl::unexpected(checked.error());
  auto setup = replay_setup(arguments, *info);
  if (!setup) return tl::unexpected(setup.error());
  auto input = open_input(std::move(*info), std::move(*setup));
  if (input) input->take_span(*checked);
  return input;
}

Expected<std::vector<ReplayInput>> read_inputs(const MapBuildArguments& arguments,
                                               const Terminal& terminal) {
  std::vector<ReplayInput> inputs;
  for (const std::string& folder : arguments.recordings) {
    auto input = read_input(arguments, folder, terminal);
    if (!input) return tl::unexpected(input.error());
    for (const ReplayInput& other : inputs) {
      std::error_code ignored;
      if (std::filesystem::equivalent(other.info.folder, folder, ignored))
        return fail(ErrorCode::kInvalid,
                    "is given twice; what it saw would count twice, and the map would seem better "
                    "than it is",
                    folder);
      if (auto same = check_same_tags(other, *input); !same) return tl::unexpected(same.error());
    }
    inputs.push_back(std::move(*input));
  }
  // Recordings without a reference tag use that of the others.
  const auto named = std::ranges::find_if(
      inputs, [](const ReplayInput& input) { return input.setup.gauge.reference_tag.has_value(); });
  for (ReplayInput& input : inputs)
    if (named != inputs.end() && !input.setup.gauge.reference_tag)
      input.setup.gauge = named->setup.gauge;
  return inputs;
}

Expected<OfflineMap> map_setup(const MapBuildArguments& arguments, const ReplayInput& first) {
  const auto config = config_of(arguments);
  if (!config) return tl::unexpected(config.error());
  OfflineMap map;
  map.config = config->map.builder;
  map.config.mode = MapMode::kMapping;
  map.start.family = first.setup.tags.family;
  // Offline all placed tags are published, with their sigmas.
  if (is_mentioned(arguments, "map", "publish_sightings"))
    map.least_sightings = map.config.publish_sightings;
  return map;
}

std::string progress_text(double share, const OfflineProgress& at) {
  const std::string tags = std::to_string(at.tags) + " tags";
  if (at.round > 0)
    return "solving for everything, round " + std::to_string(at.round) + ": " + tags;
  constexpr int kWidth = 30;
  const auto filled = static_cast<std::size_t>(share * kWidth);
  return "building the map [" + std::string(filled, '=') + std::string(kWidth - filled, ' ') +
         "] " + fixed(100 * share, 0) + " %: " + tags;
}

Expected<void> write(const MapBuildArguments& arguments, const TagMap& map,
                     const Terminal& terminal) {
  if (!arguments.out.empty()) {
    const auto remarks = write_map_file(arguments.out, map);
    if (!remarks) return tl::unexpected(remarks.error());
    for (const std::string& one : *remarks) terminal.err << arguments.out << ": " << one << "\n";
  }
  if (arguments.store.empty()) return {};
  const auto stored = store_next_version(arguments.store, map, map.comment, terminal);
  if (!stored) return tl::unexpected(stored.error());
  if (!arguments.json) print_stored(arguments.store, *stored, terminal);
  return {};
}

/// Checked before the work.
Expected<void> check_target(const MapBuildArguments& arguments) {
  if (arguments.out.empty() && arguments.store.empty())
    return fail(ErrorCode::kInvalid, "needs --out FILE or --store FILE to write the map to");
  if (arguments.out.empty()) return {};
  const auto format = map_format_of(arguments.out);
  return format ? Expected<void>{} : tl::unexpected(format.error());
}

int run_map_build(const MapBuildArguments& arguments, const Terminal& terminal) {
  if (auto target = check_target(arguments); !target) return report(terminal, target.error());
  const auto inputs = read_inputs(arguments, terminal);
  if (!inputs) return report(terminal, inputs.error());
  const auto map = map_setup(arguments, inputs->front());
  if (!map) return report(terminal, map.error());
  std::vector<MapBuildBody> bodies;
  for (const ReplayInput& input : *inputs)
    bodies.push_back(
        {{static_cast<int>(bodies.size()) + 1, input.info.folder, input.setup, input.source.get()},
         input.first,
         input.last});
  auto build = [&] {
    ProgressLine line(terminal);
    return build_map(bodies, *map, [&](double share, const OfflineProgress& at) {
      line.show(progress_text(share, at));
    });
  }();
  if (!build) return report(terminal, build.error());
  const MapBuildText text{*build, arguments.recordings, map->least_sightings.value_or(1)};
  for (const std::string& one : text.left_out()) terminal.err << "fiducap: " << one << "\n";
  for (const std::string& one : build->mismatches) terminal.err << "fiducap: " << one << "\n";
  if (tags_placed(build->map) == 0)
    return report(terminal, {ErrorCode::kNotFound,
                             std::string("no recording has given the map a tag") +
                                 (build->map.tags.empty() ? "" : " beside those that were given") +
                                 "; nothing was written",
                             ""});
  build->map.created_utc_ns = utc_now_ns();
  build->map.comment = arguments.comment.empty()
                           ? "built from " + std::to_string(inputs->size()) + " recordings"
                           : arguments.comment;
  if (auto written = write(arguments, build->map, terminal); !written)
    return report(terminal, written.error());
  if (arguments.json) return print_json(terminal, text.json());
  terminal.out << text.summary();
  return kExitOk;
}

}  // namespace

void add_map_build(CLI::App& map, ChosenVerb& chosen) {
  auto* verb = map.add_subcommand(
      "build", "One map out of recordings: of several robots, of several days, solved as one");
  auto& a = arguments_of<MapBuildArguments>(*verb, chosen, run_map_build);
  verb->add_option("RECORDING", a.recordings,
                   "Folders in the EuRoC/ASL layout. Recordings that do not overlap in time are "
                   "placed one after the other, in this order")
      ->required();
  verb->add_option("--out", a.out, "Write the map to this file: .yaml (complete), .csv");
  verb->add_option("--store", a.store,
                   "Store it as the next version of this store, map.store of the server");
  verb->add_option("--config", a.config,
                   "Take the sections estimator, detector, tags and map of a server configuration");
  verb->add_option(
      "--map", a.map,
      "Tags whose places are known (a survey, an earlier map): they stay as they are. .yaml, .csv");
  add_filter_option(*verb, a.filter);
  add_set_option(*verb, a.sets);
  verb->add_option("--comment", a.comment, "Comment in the history");
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Fails when no recording has given the map a tag.\n"
      "Example:\n"
      "  fiducap map build monday/drone monday/rover friday/drone --out hall.yaml\n"
      "  fiducap map build friday/drone --map surveyed.csv --store hall.map");
}

}  // namespace fiducap
