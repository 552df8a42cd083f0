#include "tools/live/control_command.hpp"

#include <algorithm>
#include <cstdlib>
#include <iomanip>

#include <nlohmann/json.hpp>

#include "fiducap/control.hpp"
#include "tools/live/recording_follower.hpp"
#include "tools/live/watch_command.hpp"
#include "tools/measured_places.hpp"

namespace fiducap {

namespace {

/// The connection to the server, or why there can be none.
Expected<ControlOptions> options_of(const ControlArguments& arguments) {
  const auto address = parse_server_address(arguments.server, kNativePort);
  if (!address)
    return fail(ErrorCode::kInvalid,
                "--server must be HOST or HOST:PORT, is '" + arguments.server + "'");
  ControlOptions options;
  options.server = address->host;
  options.port = address->port;
  options.token = arguments.token;
  const char* from_environment = std::getenv("FIDUCAP_TOKEN");
  if (options.token.empty() && from_environment != nullptr) options.token = from_environment;
  if (options.token.empty()) {
    return fail(ErrorCode::kInvalid,
                "needs the operator's token (operator.token of the server's configuration): "
                "export FIDUCAP_TOKEN=$(cat FILE), or --token T, which other users see");
  }
  return options;
}

int refused(const Terminal& terminal, const Outcome& outcome) {
  return report(terminal, Error{ErrorCode::kUnavailable, outcome.problem, {}});
}

/// Carries out one command and says what is so now.
template <typename Command>
int carry_out(const ControlArguments& arguments, const Terminal& terminal, const std::string& now,
              Command command) {
  const auto options = options_of(arguments);
  if (!options) return report(terminal, options.error());
  Control control(*options);
  const Outcome outcome = command(control);
  if (!outcome) return refused(terminal, outcome);
  terminal.out << now << "\n";
  return kExitOk;
}

/// The same for one body, by name or id.
template <typename Command>
int carry_out_for_body(const ControlArguments& arguments, const Terminal& terminal,
                       const std::string& now, Command command) {
  return carry_out(
      arguments, terminal, arguments.body + " " + now, [&](Control& control) -> Outcome {
        ControlState state;
        if (const Outcome outcome = control.list(state); !outcome) return outcome;
        const auto found =
            std::find_if(state.bodies.begin(), state.bodies.end(), [&](const ControlledBody& body) {
              return body.name == arguments.body || std::to_string(body.id) == arguments.body;
            });
        if (found == state.bodies.end()) {
          std::string known;
          for (const ControlledBody& body : state.bodies)
            known += (known.empty() ? "" : ", ") + body.name;
          return {false, "there is no body \"" + arguments.body + "\"; known are " + known};
        }
        return command(control, found->id);
      });
}

void print_json(const ControlState& state, std::ostream& out) {
  nlohmann::json json{{"mapping", state.mapping},
                      {"map_version", state.map_version},
                      {"recording", state.recording},
                      {"recordings", nlohmann::json::array()},
                      {"bodies", nlohmann::json::array()}};
  for (const Recording& recording : state.recordings)
    json["recordings"].push_back({{"name", recording.name},
                                  {"state", word_of(recording.state)},
                                  {"reason", recording.reason},
                                  {"samples", recording.samples},
                                  {"bytes", recording.bytes},
                                  {"dropped", recording.dropped}});
  for (const ControlledBody& body : state.bodies)
    json["bodies"].push_back(
        {{"id", body.id},
         {"name", body.name},
         {"enabled", body.enabled},
         {"pivot", {{"p", body.pivot_position_m}, {"q_wxyz", body.pivot_orientation_wxyz}}}});
  out << json.dump() << "\n";
}

void print(const ControlState& state, std::ostream& out) {
  for (const ControlledBody& body : state.bodies)
    out << std::setw(4) << body.id << "  " << std::left << std::setw(24) << body.name << std::right
        << (body.enabled ? "streamed" : "not streamed") << "\n";
  out << "map: " << (state.mapping ? "mapping" : "frozen") << ", "
      << (state.map_version == 0 ? "not stored" : "version " + std::to_string(state.map_version))
      << "; recording: " << (state.recording.empty() ? "none" : state.recording) << "\n";
  for (const Recording& recording : state.recordings)
    out << "recording \"" << recording.name << "\" " << word_of(recording.state)
        << (recording.reason.empty() ? "" : ": " + recording.reason) << "; on disk "
        << counts_of(recording) << "\n";
}

}  // namespace

int run_control_list(const ControlArguments& arguments, const Terminal& terminal) {
  const auto options = options_of(arguments);
  if (!options) return report(terminal, options.error());
  Control control(*options);
  ControlState state;
  if (const Outcome outcome = control.list(state); !outcome) return refused(terminal, outcome);
  if (arguments.json) {
    print_json(state, terminal.out);
  } else {
    print(state, terminal.out);
  }
  return kExitOk;
}

int run_control_enable(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out_for_body(arguments, terminal, "is streamed",
                            [](Control& control, int id) { return control.set_enabled(id, true); });
}

int run_control_disable(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out_for_body(arguments, terminal, "is not streamed", [](Control& control, int id) {
    return control.set_enabled(id, false);
  });
}

int run_control_rename(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out_for_body(
      arguments, terminal, "is called " + arguments.name,
      [&](Control& control, int id) { return control.rename(id, arguments.name); });
}

int run_control_freeze(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out(arguments, terminal, "the map is frozen",
                   [](Control& control) { return control.set_mapping(false); });
}

int run_control_map(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out(arguments, terminal, "the map grows",
                   [](Control& control) { return control.set_mapping(true); });
}

int run_control_commit(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out(arguments, terminal, "the map is being stored",
                   [&](Control& control) { return control.commit_map(arguments.name); });
}

int run_control_name(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out(
      arguments, terminal, "version " + std::to_string(arguments.version) + " is being named",
      [&](Control& control) { return control.name_version(arguments.version, arguments.name); });
}

int run_control_rollback(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out(arguments, terminal,
                   "the map is being rolled back to version " + std::to_string(arguments.version) +
                       "; fiducap events says when it is",
                   [&](Control& control) { return control.roll_back(arguments.version); });
}

int run_control_align(const ControlArguments& arguments, const Terminal& terminal) {
  const auto places = read_measured_places(arguments.measured);
  if (!places) return report(terminal, places.error());
  std::vector<MeasuredTag> measured;
  for (const MeasuredPlace& place : *places)
    measured.push_back({place.tag_id, {place.p_RT.x(), place.p_RT.y(), place.p_RT.z()}});
  return carry_out(
      arguments, terminal,
      "the map is aligned with the room by " + std::to_string(measured.size()) + " tags",
      [&](Control& control) { return control.align_map(measured); });
}

int run_control_quarantine(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out(arguments, terminal,
                   "tag " + std::to_string(arguments.tag_id) + " is not used any more",
                   [&](Control& control) { return control.quarantine_tag(arguments.tag_id); });
}

int run_control_forget(const ControlArguments& arguments, const Terminal& terminal) {
  return carry_out(arguments, terminal, "tag " + std::to_string(arguments.tag_id) + " is forgotten",
                   [&](Control& control) { return control.forget_tag(arguments.tag_id); });
}

int run_control_record(const ControlArguments& arguments, const Terminal& terminal) {
  const auto options = options_of(arguments);
  if (!options) return report(terminal, options.error());
  Control control(*options);
  if (const Outcome started = control.start_recording(arguments.name); !started)
    return refused(terminal, started);
  ControlState state;
  if (const Outcome outcome = control.list(state); !outcome) return refused(terminal, outcome);
  // One that has failed already is not under way, but it is the newest.
  const std::string name =
      state.recordings.empty() ? state.recording : state.recordings.back().name;
  const auto begun = follow_recording(control, name, RecordingState::kRecording,
                                      std::chrono::duration<double>(arguments.patience_s));
  if (!begun) return report(terminal, begun.error());
  terminal.out << "recording \"" << name << "\"\n";
  return kExitOk;
}

int run_control_stop(const ControlArguments& arguments, const Terminal& terminal) {
  const auto options = options_of(arguments);
  if (!options) return report(terminal, options.error());
  Control control(*options);
  ControlState state;
  if (const Outcome outcome = control.list(state); !outcome) return refused(terminal, outcome);
  if (const Outcome stopped = control.stop_recording(); !stopped) return refused(terminal, stopped);
  const auto ended = follow_recording(control, state.recording, RecordingState::kFinished,
                                      std::chrono::duration<double>(arguments.patience_s));
  if (!ended) return report(terminal, ended.error());
  terminal.out << "the recording has ended" << (*ended ? ": " + counts_of(**ended) : "") << "\n";
  return kExitOk;
}

}  // namespace fiducap
