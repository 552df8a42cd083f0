#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <iomanip>
#include <sstream>
#include <thread>

#include <nlohmann/json.hpp>

#include "base/text.hpp"
#include "daemon/operator_token.hpp"
#include "fiducap/control.hpp"
#include "tools/live/live_verbs.hpp"
#include "tools/tags/map_files.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

struct ControlArguments {
  std::string server{"127.0.0.1"};
  std::string token_file;  ///< Empty: `token`.
  std::string token;       ///< Empty: the environment's FIDUCAP_TOKEN.
  std::string body;        ///< Name or id.
  std::string name;        ///< New name of the body, of the recording or of the version.
  std::int64_t version{};  ///< Of the map.
  int tag_id{};
  std::string measured;  ///< File with measured places of tags.
  bool json{false};
  double timeout_s{10};  ///< While a recording's disk writes nothing.
};

/// Address and token of the server. @return Error when one is missing
Expected<ControlOptions> options_of(const ControlArguments& arguments) {
  const auto address = parse_server_address(arguments.server, kNativePort);
  if (!address) return tl::unexpected(address.error());
  ControlOptions options;
  options.server = address->host;
  options.port = address->port;
  options.token = arguments.token;
  if (!arguments.token_file.empty()) {
    auto token = read_token_file(arguments.token_file);
    if (!token) return tl::unexpected(token.error());
    options.token = std::move(*token);
  }
  const char* from_environment = std::getenv("FIDUCAP_TOKEN");
  if (options.token.empty() && from_environment != nullptr) options.token = from_environment;
  if (options.token.empty())
    return fail(ErrorCode::kInvalid,
                "needs the operator's token (operator.token_file of the server's configuration): "
                "--token-file FILE, or export FIDUCAP_TOKEN=$(cat FILE)");
  return options;
}

Error refusal(const Outcome& outcome) { return {ErrorCode::kUnavailable, outcome.problem, {}}; }

Expected<ControlState> state_of(Control& control) {
  ControlState state;
  if (const Outcome outcome = control.list(state); !outcome)
    return tl::unexpected(refusal(outcome));
  return state;
}

// ---- Recordings

std::string size_text(std::uint64_t bytes) {
  const auto count = static_cast<double>(bytes);
  if (count >= 1e9) return fixed(count * 1e-9, 2) + " GB";
  if (count >= 1e6) return fixed(count * 1e-6, 1) + " MB";
  return fixed(count * 1e-3, 1) + " kB";
}

/// `1200 samples, 3.4 MB; 0 dropped`
std::string counts_of(const Recording& recording) {
  return std::to_string(recording.samples) + " samples, " + size_text(recording.bytes) + "; " +
         std::to_string(recording.dropped) + " dropped";
}

const char* name_of(RecordingState state) {
  constexpr std::array kNames{"starting", "recording", "stopping", "finished", "failed"};
  const auto i = static_cast<std::size_t>(state);
  return i < kNames.size() ? kNames[i] : "unknown";
}

Error stalled(const Recording& recording, std::chrono::duration<double> timeout) {
  const bool begins = recording.state == RecordingState::kStarting;
  return {ErrorCode::kUnavailable,
          "the recording \"" + recording.name + "\"" +
              (begins ? " has not begun" : " is still being written") +
              ": its disk has taken nothing for " + fixed(timeout.count(), 1) +
              " s. The samples wait in the server's memory; `fiducap control list` shows its state "
              "(so far " +
              counts_of(recording) + ")",
          {}};
}

/// Polls the server's list until the recording has reached the state `wanted`, or is over.
/// @param timeout  without progress on disk
/// @return nullopt: the server does not list it (it is older than this program); Error when the
/// server cannot be asked, after the timeout, and when the recording has failed
Expected<std::optional<Recording>> follow_recording(Control& control, const std::string& name,
                                                    RecordingState wanted,
                                                    std::chrono::duration<double> timeout) {
  constexpr std::chrono::milliseconds kPollPeriod{50};
  auto progress_at = std::chrono::steady_clock::now();
  std::uint64_t bytes = 0;
  for (;;) {
    const auto state = state_of(control);
    if (!state) return tl::unexpected(state.error());
    const auto& all = state->recordings;
    const auto newest = std::find_if(all.rbegin(), all.rend(),
                                     [&](const Recording& one) { return one.name == name; });
    if (newest == all.rend()) return std::nullopt;
    if (newest->state == RecordingState::kFailed)
      return fail(ErrorCode::kUnavailable, "the recording \"" + name + "\" has failed: " +
                                               newest->reason + "; saved: " + counts_of(*newest));
    if (newest->state >= wanted) return *newest;
    const auto now = std::chrono::steady_clock::now();
    if (newest->bytes != bytes) progress_at = now;
    bytes = newest->bytes;
    if (now - progress_at > timeout) return tl::unexpected(stalled(*newest, timeout));
    std::this_thread::sleep_for(kPollPeriod);
  }
}

// ---- Commands

/// One command; its result is the text that is printed.
using Command = Expected<std::string> (*)(const ControlArguments&, Control&);

Expected<std::string> done_if(const Outcome& outcome, const std::string& text) {
  return outcome ? Expected<std::string>(text) : tl::unexpected(refusal(outcome));
}

/// The id of the body with this name or id.
Expected<int> find_body(Control& control, const std::string& body) {
  const auto state = state_of(control);
  if (!state) return tl::unexpected(state.error());
  for (const ControlledBody& one : state->bodies)
    if (one.name == body || std::to_string(one.id) == body) return one.id;
  return fail(ErrorCode::kUnavailable,
              "there is no body \"" + body + "\"; known are " +
                  comma_list(state->bodies, [](const auto& one) { return one.name; }));
}

Expected<std::string> enable(const ControlArguments& a, Control& control, bool enabled) {
  const auto id = find_body(control, a.body);
  if (!id) return tl::unexpected(id.error());
  return done_if(control.set_enabled(*id, enabled),
                 a.body + (enabled ? " is streamed" : " is not streamed"));
}

Expected<std::string> rename(const ControlArguments& a, Control& control) {
  const auto id = find_body(control, a.body);
  if (!id) return tl::unexpected(id.error());
  return done_if(control.rename(*id, a.name), a.body + " is called " + a.name);
}

Expected<std::string> name_version(const ControlArguments& a, Control& control) {
  return done_if(control.name_version(a.version, a.name),
                 "version " + std::to_string(a.version) + " is being named");
}

Expected<std::string> roll_back(const ControlArguments& a, Control& control) {
  return done_if(control.roll_back(a.version), "the map is being rolled back to version " +
                                                   std::to_string(a.version) +
                                                   "; fiducap events reports the end");
}

Expected<std::string> align_with_room(const ControlArguments& a, Control& control) {
  const auto places = read_measured_places(a.measured);
  if (!places) return tl::unexpected(places.error());
  std::vector<MeasuredTag> measured;
  for (const MeasuredPlace& place : *places)
    measured.push_back({place.tag_id, {place.p_RT.x(), place.p_RT.y(), place.p_RT.z()}});
  return done_if(control.align_map(measured), "the map is aligned with the room by " +
                                                  std::to_string(measured.size()) + " tags");
}

Expected<std::string> record(const ControlArguments& a, Control& control) {
  if (const Outcome started = control.start_recording(a.name); !started)
    return tl::unexpected(refusal(started));
  const auto state = state_of(control);
  if (!state) return tl::unexpected(state.error());
  // A recording that has failed already is not the running one, but the newest.
  const std::string name =
      state->recordings.empty() ? state->recording : state->recordings.back().name;
  const auto begun = follow_recording(control, name, RecordingState::kRecording,
                                      std::chrono::duration<double>(a.timeout_s));
  if (!begun) return tl::unexpected(begun.error());
  return "recording \"" + name + "\"";
}

Expected<std::string> stop(const ControlArguments& a, Control& control) {
  const auto state = state_of(control);
  if (!state) return tl::unexpected(state.error());
  if (const Outcome stopped = control.stop_recording(); !stopped)
    return tl::unexpected(refusal(stopped));
  const auto ended = follow_recording(control, state->recording, RecordingState::kFinished,
                                      std::chrono::duration<double>(a.timeout_s));
  if (!ended) return tl::unexpected(ended.error());
  return "the recording has ended" + (*ended ? ": " + counts_of(**ended) : std::string());
}

std::string state_json(const ControlState& state) {
  nlohmann::json json{{"mapping", state.mapping},
                      {"map_version", state.map_version},
                      {"recording", state.recording},
                      {"recordings", nlohmann::json::array()},
                      {"bodies", nlohmann::json::array()}};
  for (const Recording& recording : state.recordings)
    json["recordings"].push_back({{"name", recording.name},
                                  {"state", name_of(recording.state)},
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
  return json.dump();
}

std::string state_text(const ControlState& state) {
  std::ostringstream out;
  for (const ControlledBody& body : state.bodies)
    out << std::setw(4) << body.id << "  " << std::left << std::setw(24) << body.name << std::right
        << (body.enabled ? "streamed" : "not streamed") << "\n";
  out << "map: " << (state.mapping ? "mapping" : "frozen") << ", "
      << (state.map_version == 0 ? "not stored" : "version " + std::to_string(state.map_version))
      << "; recording: " << (state.recording.empty() ? "none" : state.recording);
  for (const Recording& recording : state.recordings)
    out << "\nrecording \"" << recording.name << "\" " << name_of(recording.state)
        << (recording.reason.empty() ? "" : ": " + recording.reason) << "; on disk "
        << counts_of(recording);
  return out.str();
}

Expected<std::string> list(const ControlArguments& a, Control& control) {
  const auto state = state_of(control);
  if (!state) return tl::unexpected(state.error());
  return a.json ? state_json(*state) : state_text(*state);
}

// ---- Options

/// Adds the verbs of `fiducap control`.
class ControlVerbs final {
 public:
  ControlVerbs(CLI::App& control, ChosenVerb& chosen) : control_(control), chosen_(chosen) {}

  void add_bodies_and_mode() {
    add("list", "Bodies, map mode, recording", list)
        .add_flag("--json", arguments_->json, "One JSON object");
    add_for_body("enable", "Stream a body again",
                 [](const auto& a, Control& control) { return enable(a, control, true); });
    add_for_body("disable", "Stream a body no more; its tracking continues",
                 [](const auto& a, Control& control) { return enable(a, control, false); });
    add_for_body("rename", "Give a body another name until the server ends", rename, " rover scout")
        .add_option("NAME", arguments_->name, "letters of any script, digits, spaces, _ - . + ( )")
        ->required();
    add("freeze", "Freeze the map", [](const auto&, Control& control) {
      return done_if(control.set_mapping(false), "the map is frozen");
    });
    add("map", "Let the map grow and be refined", [](const auto&, Control& control) {
      return done_if(control.set_mapping(true), "the map grows");
    });
  }

  void add_map_commands() {
    add(
        "commit", "Store the map now",
        [](const auto& a, Control& control) {
          return done_if(control.commit_map(a.name), "the map is being stored");
        },
        " before-the-move")
        .add_option("NAME", arguments_->name, "Name of the version in the history");
    add_for_version("name", "Name a stored version of the map: named versions are kept",
                    name_version, " 12 before-the-move")
        .add_option("NAME", arguments_->name, "1 to 200 characters")
        ->required();
    add_for_version("rollback", "Serve a stored version of the map again, as a new version",
                    roll_back, " 12");
    add("align", "Align the workspace with the room by measured tags; streamed poses jump",
        align_with_room, " --to measured.csv")
        .add_option("--to", arguments_->measured,
                    "Three tags or more as measured in the room: id,x,y,z in metres, z up")
        ->required();
    add_for_tag("quarantine", "Keep a tag in the map and do not use it",
                [](const auto& a, Control& control) {
                  return done_if(control.quarantine_tag(a.tag_id),
                                 "tag " + std::to_string(a.tag_id) + " is not used any more");
                });
    add_for_tag("forget", "Remove a tag from the map: seen again, it is a new one",
                [](const auto& a, Control& control) {
                  return done_if(control.forget_tag(a.tag_id),
                                 "tag " + std::to_string(a.tag_id) + " is forgotten");
                });
  }

  void add_recording() {
    add_for_recording("record", "Record the sensors of all bodies", record)
        .add_option("NAME", arguments_->name, "Of the folder; without it the date and time");
    add_for_recording("stop", "End the recording and report what is on disk", stop);
  }

 private:
  CLI::App& add(const std::string& name, const char* what, Command command,
                const std::string& example = "") {
    auto& verb = *control_.add_subcommand(name, what);
    arguments_ = &arguments_of<ControlArguments>(
        verb, chosen_, [command](const ControlArguments& arguments, const Terminal& terminal) {
          if (!arguments.token.empty())
            terminal.err << "fiducap: warning: every user of this machine sees --token: use "
                            "--token-file, and choose a new token\n";
          const auto options = options_of(arguments);
          if (!options) return report(terminal, options.error());
          Control control(*options);
          const auto done = command(arguments, control);
          if (!done) return report(terminal, done.error());
          terminal.out << *done << "\n";
          return kExitOk;
        });
    add_server_option(verb, arguments_->server);
    auto* file = verb.add_option("--token-file", arguments_->token_file,
                                 "File with the operator's token; without it: the environment's "
                                 "FIDUCAP_TOKEN");
    // Of earlier versions: every user of the machine sees command lines.
    verb.add_option("--token", arguments_->token, "")->group("")->excludes(file);
    verb.footer("Example:\n  fiducap control " + name + example + " --token-file robot.token");
    return verb;
  }
  CLI::App& add_for_body(const char* name, const char* what, Command command,
                         const char* example = " rover") {
    CLI::App& verb = add(name, what, command, example);
    verb.add_option("BODY", arguments_->body, "Its name or id")->required();
    return verb;
  }
  CLI::App& add_for_version(const char* name, const char* what, Command command,
                            const char* example) {
    CLI::App& verb = add(name, what, command, example);
    verb.add_option("VERSION", arguments_->version, "Its number, as on the page and in the map log")
        ->required();
    return verb;
  }
  void add_for_tag(const char* name, const char* what, Command command) {
    add(name, what, command, " 7")
        .add_option("TAG", arguments_->tag_id, "Its id")
        ->required()
        ->check(CLI::NonNegativeNumber);
  }
  CLI::App& add_for_recording(const char* name, const char* what, Command command) {
    CLI::App& verb = add(name, what, command);
    verb.add_option("--patience", arguments_->timeout_s,
                    "Seconds to wait while the disk takes nothing of the recording")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    return verb;
  }

  CLI::App& control_;
  ChosenVerb& chosen_;
  ControlArguments* arguments_{nullptr};  ///< Of the verb added last.
};

}  // namespace

void add_control(CLI::App& app, ChosenVerb& chosen) {
  auto* control = app.add_subcommand("control", "Change a running server: bodies, map, recording");
  control->require_subcommand(1);
  control->footer(
      "operator.token_file of the server's configuration names the token's file.\n"
      "Instead of --token-file: export FIDUCAP_TOKEN=$(cat robot.token)\n"
      "Example:\n  fiducap control disable rover --token-file robot.token\n"
      "  fiducap control record flight-3 --token-file robot.token");
  ControlVerbs verbs(*control, chosen);
  verbs.add_bodies_and_mode();
  verbs.add_map_commands();
  verbs.add_recording();
}

}  // namespace fiducap
