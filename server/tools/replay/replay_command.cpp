#include "tools/replay/replay_command.hpp"

#include <filesystem>

#include <yaml-cpp/yaml.h>

#include "daemon/config/config_file.hpp"
#include "daemon/system_clock.hpp"
#include "tools/replay/run_files.hpp"
#include "tools/tags/map_file.hpp"

namespace fiducap {
namespace {

/// Whether the user says anything about `section.key`: what nobody mentions stays as the recording
/// has it.
class Mentioned final {
 public:
  Mentioned(const std::string& file, const std::vector<std::string>& sets) : sets_(sets) {
    if (!file.empty()) root_ = YAML::LoadFile(file);
  }
  [[nodiscard]] bool operator()(const std::string& section, const std::string& key) const {
    const std::string path = section + "." + key;
    for (const std::string& set : sets_)
      if (set.starts_with(path) && set.size() > path.size() &&
          (set[path.size()] == '=' || set[path.size()] == '.'))
        return true;
    // A missing key gives a node that throws at any question but IsDefined.
    if (!root_.IsMap() || !root_[section].IsDefined() || !root_[section].IsMap()) return false;
    return root_[section][key].IsDefined();
  }

 private:
  const std::vector<std::string>& sets_;
  YAML::Node root_;
};

Expected<void> apply_config(const ReplayArguments& arguments, OfflineSetup& setup) {
  const auto config = load_config(arguments.config, arguments.sets);
  if (!config) {
    std::string faults;
    for (const ConfigFault& fault : config.error())
      faults += (faults.empty() ? "" : "\n  ") + fault.text();
    return fail(ErrorCode::kInvalid, faults,
                config.error().size() > 1 ? "several faults\n  " : "configuration");
  }
  const Mentioned mentioned(arguments.config, arguments.sets);
  setup.estimator = config->estimator;
  setup.detector = config->detector;
  if (mentioned("tags", "family")) setup.tags.family = config->tags.family;
  if (mentioned("tags", "size_m")) setup.tags.size_m = config->tags.size_m;
  if (mentioned("tags", "sizes_m")) setup.tags.sizes_m = config->tags.sizes_m;
  if (mentioned("tags", "ignore")) setup.tags.ignore = config->tags.ignore;
  if (mentioned("map", "reference_tag"))
    setup.gauge = {config->map.reference_tag, config->map.reference_pose};
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

void print_summary(const Terminal& terminal, const ReplayArguments& arguments,
                   const RecordingInfo& info, const OfflineResult& result) {
  const OfflineStatistics& s = result.statistics;
  const double cpu =
      s.read_cpu_s + s.detect_cpu_s + s.propagate_cpu_s + s.update_cpu_s + s.settle_cpu_s;
  terminal.out << info.name << ": " << fixed(s.data_s, 1) << " s of data in " << fixed(cpu, 2)
               << " s of CPU (read " << fixed(s.read_cpu_s, 2) << ", detect "
               << fixed(s.detect_cpu_s, 2) << ", propagate " << fixed(s.propagate_cpu_s, 2)
               << ", update " << fixed(s.update_cpu_s, 2) << ", settle " << fixed(s.settle_cpu_s, 2)
               << ")\n"
               << "  " << s.frames << " frames, " << s.frames_with_tags << " with tags, "
               << s.frames_with_tags_and_pose << " of these with a pose; " << result.tags.size()
               << " tags mapped, " << result.known.size() << " known\n"
               << "  reprojection median " << fixed(s.reprojection_median_px, 2) << " px, 95 % "
               << fixed(s.reprojection_p95_px, 2) << " px; NIS per degree of freedom "
               << fixed(s.nis_per_dof(), 2) << ", " << s.tags_rejected << " of "
               << s.tags_rejected + s.tags_used << " sightings rejected\n"
               << "  written to " << arguments.out << "; next: fiducap evaluate "
               << (std::filesystem::path(arguments.out) / (info.name + ".tum")).string() << " "
               << arguments.recording << "\n";
}

void print_doubts(const Terminal& terminal, const OfflineResult& result) {
  for (const std::string& doubt : result.doubts) terminal.out << "  warning: " << doubt << "\n";
}

}  // namespace

Expected<OfflineSetup> replay_setup(const ReplayArguments& arguments, const RecordingInfo& info) {
  OfflineSetup setup = offline_setup(info);
  if (auto applied = apply_config(arguments, setup); !applied)
    return tl::unexpected(applied.error());
  if (!arguments.filter.empty()) setup.filter = arguments.filter;
  if (!arguments.map.empty())
    if (auto applied = apply_map(arguments.map, setup); !applied)
      return tl::unexpected(applied.error());
  return setup;
}

int run_replay(const ReplayArguments& arguments, const Terminal& terminal) {
  const auto info = read_recording_info(arguments.recording);
  if (!info) return report(terminal, info.error());
  const auto setup = replay_setup(arguments, *info);
  if (!setup) return report(terminal, setup.error());
  const SystemClock clock;
  const auto source = open_recording(*info, {}, clock);
  if (!source) return report(terminal, source.error());

  const auto result = [&] {
    ProgressLine line(terminal);
    return run_offline(*setup, **source, [&](double data_s) {
      line.show("replaying " + info->name + ": " + fixed(data_s, 1) + " s of data");
    });
  }();
  if (!result) return report(terminal, result.error());
  if (auto written = write_run_files(arguments.out, info->name, *setup, *result); !written)
    return report(terminal, written.error());
  if (arguments.json) {
    terminal.out << run_report(info->name, *setup, *result);
  } else {
    print_summary(terminal, arguments, *info, *result);
    print_doubts(terminal, *result);
  }
  if (result->statistics.frames == 0)
    return report(terminal,
                  {ErrorCode::kNotFound, "has neither images nor detections", arguments.recording});
  return kExitOk;
}

}  // namespace fiducap
