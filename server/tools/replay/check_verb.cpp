#include <nlohmann/json.hpp>

#include "tools/replay/replay_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

struct CheckArguments {
  std::vector<std::string> recordings;
  bool json{false};
};

void print_stream(const Terminal& terminal, const RecordedStream& stream) {
  terminal.out << "  " << stream.file << ": " << stream.stamps << " lines";
  if (stream.stamps > 0) {
    terminal.out << ", " << fixed(to_seconds(stream.last - stream.first), 1) << " s";
    if (stream.step > Duration{0})
      terminal.out << ", one in " << fixed(1e3 * to_seconds(stream.step), 1) << " ms";
  }
  if (stream.left_out > 0)
    terminal.out << "; " << stream.left_out
                 << " left out: their stamps are out of order or far from the others";
  terminal.out << "\n";
}

nlohmann::ordered_json check_json(const std::string& folder, const RecordingReport& checked) {
  nlohmann::ordered_json streams = nlohmann::ordered_json::array();
  for (const RecordedStream& stream : checked.streams)
    streams.push_back({{"file", stream.file},
                       {"lines", stream.stamps},
                       {"left_out", stream.left_out},
                       {"unreadable", stream.unreadable},
                       {"seconds", stream.stamps > 0 ? to_seconds(stream.last - stream.first) : 0},
                       {"step_s", to_seconds(stream.step)}});
  return {{"recording", folder},
          {"usable", checked.is_usable()},
          {"streams", streams},
          {"findings", findings_json(checked.findings)}};
}

int run_check(const CheckArguments& arguments, const Terminal& terminal) {
  int exit_code = kExitOk;
  nlohmann::ordered_json recordings = nlohmann::ordered_json::array();
  for (const std::string& folder : arguments.recordings) {
    const auto checked = read_recording_info(folder).and_then(check_recording);
    if (!checked || !checked->is_usable()) exit_code = kExitFailed;
    if (!checked) {
      report(terminal, checked.error());
      recordings.push_back(
          {{"recording", folder}, {"usable", false}, {"error", checked.error().text()}});
    } else if (arguments.json) {
      recordings.push_back(check_json(folder, *checked));
    } else {
      terminal.out << folder << "\n";
      for (const RecordedStream& stream : checked->streams) print_stream(terminal, stream);
      print_findings(terminal, checked->findings);
      if (checked->findings.empty()) terminal.out << "  no findings\n";
    }
  }
  if (arguments.json) print_json(terminal, {{"recordings", recordings}});
  return exit_code;
}

}  // namespace

void add_check(CLI::App& app, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand(
      "check", "Can this recording be used? Stamps, clocks, units of the IMU, order of corners");
  auto& a = arguments_of<CheckArguments>(*verb, chosen, run_check);
  verb->add_option("RECORDING", a.recordings, "Folders in the EuRoC/ASL layout")->required();
  verb->add_flag("--json", a.json, "One JSON object for scripts");
  verb->footer("Fails when a recording is unusable.\nExample:\n  fiducap check recordings/hall");
}

}  // namespace fiducap
