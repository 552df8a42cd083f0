#include <algorithm>
#include <filesystem>

#include <yaml-cpp/yaml.h>
#include <nlohmann/json.hpp>

#include "capture/recording/recording_layout.hpp"
#include "daemon/bodies/body_setup.hpp"
#include "daemon/system.hpp"
#include "mapping/store/map_store.hpp"
#include "tools/replay/replay_verbs.hpp"
#include "tools/tags/map_files.hpp"

namespace fiducap {
namespace {

/// A server's session: its configuration and what the live server wrote around the recordings.
bool is_session(const std::string& folder) {
  const std::filesystem::path path(folder);
  return is_file(path / "config.yaml") && is_file(path / "map.yaml") && is_file(path / "turns.csv");
}

Expected<void> apply_config(const SetupArguments& arguments, OfflineSetup& setup) {
  const auto config = load_config(arguments.config, arguments.sets);
  if (!config) {
    std::string faults;
    for (const ConfigFault& fault : config.error())
      faults += (faults.empty() ? "" : "\n  ") + fault.text();
    return fail(ErrorCode::kInvalid, faults,
                config.error().size() > 1 ? "several faults\n  " : "configuration");
  }
  const auto mentioned = [&](const char* section, const char* key) {
    return is_mentioned(arguments, section, key);
  };
  setup.estimator = config->estimator;
  setup.detector = config->detector;
  if (const auto gravity = config->site.configured_gravity())
    setup.sensors.set_known_gravity(*gravity);
  if (mentioned("tags", "family")) setup.tags.family = config->tags.family;
  if (mentioned("tags", "size_m")) setup.tags.size_m = config->tags.size_m;
  if (mentioned("tags", "sizes_m")) setup.tags.sizes_m = config->tags.sizes_m;
  if (mentioned("tags", "ignore")) setup.tags.ignore = config->tags.ignore;
  if (mentioned("map", "reference_tag"))
    setup.gauge = {config->map.reference_tag, config->map.reference_pose, {}};
  if (mentioned("map", "floor_tags")) setup.gauge.floor_tags = config->map.floor_tags;
  return {};
}

Expected<void> apply_map(const std::string& path, OfflineSetup& setup) {
  const auto map = read_map_file(path);
  if (!map) return tl::unexpected(map.error());
  for (const MapTag& entry : map->tags) {
    std::erase_if(setup.known, [&](const KnownTag& t) { return t.tag_id == entry.tag.tag_id; });
    std::erase_if(setup.priors, [&](const KnownTag& t) { return t.tag_id == entry.tag.tag_id; });
    setup.known.push_back(entry.tag);
    if (entry.tag.tag_id == setup.gauge.reference_tag) setup.gauge.X_WT = entry.tag.X_WT;
  }
  return {};
}

/// The pipeline of the live server.
OfflineSetup session_setup(const ReplayArguments& arguments, const ServerConfig& session,
                           std::size_t body, const RecordingInfo& info) {
  const BodyConfig& config = session.bodies[body];
  OfflineSetup setup = offline_setup(info);
  auto live = read_body_setup(config, session.simulation, session.site);
  static_cast<PipelineSetup&>(setup) =
      pipeline_setup(session, config, live ? *live : BodySetup{setup.sensors, {}, {}});
  setup.known.clear();  // the session's map has them
  if (!arguments.filter.empty()) setup.filter = arguments.filter;
  return setup;
}

/// @param session  its configuration; nullptr: none
Expected<void> add_body(const ReplayArguments& arguments, const std::string& folder,
                        const ServerConfig* session, ReplayInputs& inputs) {
  auto info = read_recording_info(folder);
  if (!info) return tl::unexpected(info.error());
  for (const ReplayInput& other : inputs.bodies) {
    if (other.info.name == info->name)
      return fail(ErrorCode::kInvalid, "two recordings have this name; their files would be mixed",
                  info->name);
    if (other.setup.gauge.reference_tag != info->reference_tag && session == nullptr)
      return fail(ErrorCode::kInvalid,
                  "names another reference tag than " + other.info.name +
                      ": one map has one; give --set map.reference_tag=N",
                  info->name);
  }
  auto setup = session == nullptr ? replay_setup(arguments, *info)
                                  : session_setup(arguments, *session, inputs.bodies.size(), *info);
  if (!setup) return tl::unexpected(setup.error());
  if (auto fault = fault_of_filter(setup->filter, setup->sensors))
    return fail(ErrorCode::kInvalid, std::move(*fault), info->name);
  auto input = open_input(std::move(*info), std::move(*setup));
  if (!input) return tl::unexpected(input.error());
  inputs.bodies.push_back(std::move(*input));
  return {};
}

Expected<void> add_session(const ReplayArguments& arguments, const std::string& folder,
                           ReplayInputs& inputs) {
  if (!arguments.map.empty() || !arguments.config.empty())
    return fail(ErrorCode::kInvalid,
                "a session starts from its own map and configuration: leave --map and --config out "
                "(--set changes single keys)",
                folder);
  const std::filesystem::path path(folder);
  const std::string file = (path / "config.yaml").string();
  const auto config = load_config(file, arguments.sets);
  if (!config) return fail(ErrorCode::kInvalid, config.error().front().text(), file);
  auto map = read_map_file((path / "map.yaml").string());
  if (!map) return tl::unexpected(map.error());
  auto turns = read_map_turns(path / "turns.csv");
  if (!turns) return tl::unexpected(turns.error());
  if (is_file(path / "refinements.csv")) {
    auto refinements = read_refinement_turns(path / "refinements.csv");
    if (!refinements) return tl::unexpected(refinements.error());
    inputs.map.refinements = std::move(*refinements);
  }
  for (const BodyConfig& body : config->bodies)
    if (auto added = add_body(arguments, (path / body.name).string(), &*config, inputs); !added)
      return added;
  inputs.map.config = config->map.builder;
  inputs.map.start = std::move(*map);
  inputs.map.turns = std::move(*turns);
  inputs.is_session = true;
  return {};
}

/// The configured period of refinements.
Expected<void> apply_refinement(const ReplayArguments& arguments, ReplayInputs& inputs) {
  if (!is_mentioned(arguments, "map", "refine_period_s")) return {};
  const auto config = config_of(arguments);
  if (!config) return tl::unexpected(config.error());
  inputs.map.config.refine_period_s = config->map.builder.refine_period_s;
  return {};
}

Expected<TagMap> newest_version(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    return fail(ErrorCode::kNotFound, "is not there", path);
  const auto store = MapStore::open_to_read(path);
  if (!store) return tl::unexpected(store.error());
  auto map = store->newest();
  if (map && map->version == 0)
    return fail(ErrorCode::kNotFound, "holds no version of a map yet", path);
  return map;
}

void prepare_to_resolve(ReplayInputs& inputs) {
  inputs.map.resolve = true;
  // The order in which the live server's threads ran does not matter any more.
  inputs.map.turns.clear();
  inputs.map.refinements.reset();
}

Expected<void> check_arguments(const ReplayArguments& arguments) {
  if (arguments.recordings.size() > 1 && !arguments.together)
    return fail(ErrorCode::kInvalid,
                "several recordings share a map with --together; without it, replay them one by "
                "one");
  if (!arguments.store.empty() && !arguments.map.empty())
    return fail(ErrorCode::kInvalid, "give --map or --store, not both: a run begins with one map");
  return {};
}

}  // namespace

void print_findings(const Terminal& terminal, const std::vector<RecordingFinding>& findings) {
  for (const RecordingFinding& finding : findings)
    terminal.out << (finding.unusable ? "  unusable: " : "  warning: ") << finding.text << "\n";
}

nlohmann::ordered_json findings_json(const std::vector<RecordingFinding>& findings) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const RecordingFinding& finding : findings)
    all.push_back({{"unusable", finding.unusable}, {"text", finding.text}});
  return all;
}

Expected<RecordingReport> require_usable(const RecordingInfo& info, const Terminal& terminal) {
  auto checked = check_recording(info);
  if (!checked) return tl::unexpected(checked.error());
  for (std::size_t i = checked->is_usable() ? 0 : 1; i < checked->findings.size(); ++i) {
    const RecordingFinding& finding = checked->findings[i];
    terminal.err << "fiducap: " << (finding.unusable ? "" : "warning: ") << info.folder << ": "
                 << finding.text << "\n";
  }
  if (checked->is_usable()) return std::move(*checked);
  return fail(ErrorCode::kInvalid, checked->findings.front().text, info.folder);
}

void ReplayInput::take_span(const RecordingReport& report) {
  for (const RecordedStream& stream : report.streams) {
    if (stream.stamps == 0) continue;
    first = std::min(first, stream.first);
    last = std::max(last, stream.last);
  }
}

Expected<ReplayInput> open_input(RecordingInfo info, OfflineSetup setup) {
  static const SystemClock clock;
  auto source = open_recording(info, {}, clock);
  if (!source) return tl::unexpected(source.error());
  return ReplayInput{std::move(info), std::move(setup), std::move(*source)};
}

bool is_mentioned(const SetupArguments& arguments, const std::string& section,
                  const std::string& key) {
  const std::string path = section + "." + key;
  for (const std::string& set : arguments.sets)
    if (set.starts_with(path) && set.size() > path.size() &&
        (set[path.size()] == '=' || set[path.size()] == '.'))
      return true;
  const YAML::Node root =
      arguments.config.empty() ? YAML::Node{} : YAML::LoadFile(arguments.config);
  // The node of a missing key throws in every call but IsDefined.
  if (!root.IsMap() || !root[section].IsDefined() || !root[section].IsMap()) return false;
  return root[section][key].IsDefined();
}

Expected<ServerConfig> config_of(const SetupArguments& arguments) {
  auto config = load_config(arguments.config, arguments.sets);
  if (!config) return fail(ErrorCode::kInvalid, config.error().front().text(), "configuration");
  return std::move(*config);
}

Expected<OfflineSetup> replay_setup(const SetupArguments& arguments, const RecordingInfo& info) {
  OfflineSetup setup = offline_setup(info);
  if (auto applied = apply_config(arguments, setup); !applied)
    return tl::unexpected(applied.error());
  if (!arguments.filter.empty()) setup.filter = arguments.filter;
  if (!arguments.map.empty())
    if (auto applied = apply_map(arguments.map, setup); !applied)
      return tl::unexpected(applied.error());
  return setup;
}

Expected<ReplayInputs> read_replay_inputs(const ReplayArguments& arguments) {
  if (auto sound = check_arguments(arguments); !sound) return tl::unexpected(sound.error());
  ReplayInputs inputs;
  for (const std::string& folder : arguments.recordings) {
    const bool whole = is_session(folder);
    if (whole && arguments.recordings.size() > 1)
      return fail(ErrorCode::kInvalid, "is a whole session: replay it alone", folder);
    if (auto added = whole ? add_session(arguments, folder, inputs)
                           : add_body(arguments, folder, nullptr, inputs);
        !added)
      return tl::unexpected(added.error());
  }
  if (!inputs.is_session)
    if (auto applied = apply_refinement(arguments, inputs); !applied)
      return tl::unexpected(applied.error());
  if (!arguments.store.empty()) {
    if (inputs.is_session)
      return fail(ErrorCode::kInvalid, "a session starts from its own map: leave --store out",
                  arguments.store);
    auto map = newest_version(arguments.store);
    if (!map) return tl::unexpected(map.error());
    if (map->family != inputs.bodies.front().setup.tags.family)
      return fail(ErrorCode::kInvalid,
                  "its tags are of " + map->family + ", those of the recording of " +
                      inputs.bodies.front().setup.tags.family,
                  arguments.store);
    inputs.map.start = std::move(*map);
  }
  // One robot out of a session starts from the map that it had then.
  if (!inputs.is_session && arguments.store.empty() && arguments.recordings.size() == 1) {
    std::error_code ignored;
    const auto whole = std::filesystem::canonical(arguments.recordings.front(), ignored);
    if (const std::string session = whole.parent_path().string(); is_session(session)) {
      auto map = read_map_file(session + "/map.yaml");
      if (!map) return tl::unexpected(map.error());
      inputs.map.start = std::move(*map);
    }
  }
  if (arguments.resolve) prepare_to_resolve(inputs);
  return inputs;
}

Expected<void> check_replay_inputs(const ReplayArguments& arguments, ReplayInputs& inputs,
                                   const Terminal& terminal) {
  for (ReplayInput& input : inputs.bodies) {
    const auto usable = require_usable(input.info, terminal);
    if (usable) {
      input.take_span(*usable);
      continue;
    }
    if (!arguments.anyway && !inputs.is_session)
      return fail(usable.error().code, usable.error().what + " (--anyway runs it all the same)",
                  usable.error().context);
    terminal.err << "fiducap: warning: " << usable.error().text() << "\n";
  }
  return {};
}

}  // namespace fiducap
