#include <array>
#include <ctime>

#include <fmt/chrono.h>
#include <nlohmann/json.hpp>

#include "base/text.hpp"
#include "tools/live/live_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

constexpr std::chrono::milliseconds kSlice{100};  // bounds the delay of an interrupt

struct EventsArguments {
  std::string server{"127.0.0.1"};
  double duration_s{0};  ///< 0: until interrupted.
  bool only_new{false};  ///< Without the events that the server remembers.
  bool json{false};      ///< One JSON object per event and line.
};

const char* name_of(EventSeverity severity) {
  constexpr std::array<const char*, 3> kNames{"info", "warning", "error"};
  return kNames[static_cast<std::size_t>(severity)];
}

std::string time_text(std::int64_t utc_ms) {
  const std::time_t seconds = utc_ms / 1000;
  std::tm local{};
  if (::localtime_r(&seconds, &local) == nullptr) return "?";
  return fmt::format("{:%F %T}.{:03}", local, utc_ms % 1000);
}

std::string event_json(const ServerEvent& event) {
  const nlohmann::json all{{"number", event.number},
                           {"utc_ms", event.at_utc_ms},
                           {"severity", name_of(event.severity)},
                           {"subject", event.subject},
                           {"kind", event.kind},
                           {"text", event.text},
                           {"remedy", event.remedy},
                           {"over", event.over}};
  return all.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

int run_events(const EventsArguments& arguments, const Terminal& terminal) {
  const auto address = parse_server_address(arguments.server, kNativePort);
  if (!address) return report(terminal, address.error());
  EventWatch watch({address->host, address->port, !arguments.only_new});
  const auto start = std::chrono::steady_clock::now();
  bool reached = false;
  std::string reported;
  ServerEvent event;
  while (!interrupted() && terminal.out) {
    if (watch.next(event, kSlice))
      terminal.out << (arguments.json ? event_json(event) : event_line(event)) << std::flush;
    reached = reached || watch.problem().empty();
    if (watch.problem() != reported && !(reported = watch.problem()).empty())
      terminal.err << "fiducap: " << reported << "; retrying" << std::endl;
    if (is_over(start, arguments.duration_s)) break;
  }
  return reached ? kExitOk : kExitFailed;
}

}  // namespace

std::string event_line(const ServerEvent& event) {
  std::string severity = name_of(event.severity);
  severity.resize(8, ' ');
  const std::string remedy = event.remedy.empty() ? "" : " – " + event.remedy;
  return time_text(event.at_utc_ms) + " " + severity +
         printable(event.subject + ": " + event.text + remedy) + "\n";
}

void add_events(CLI::App& app, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand(
      "events", "Events of a server: bodies lost and found, devices, disks, clocks");
  auto& a = arguments_of<EventsArguments>(*verb, chosen, run_events);
  add_server_option(*verb, a.server);
  add_positive(*verb, "--duration", a.duration_s,
               "End after this many seconds; fails when the server was never reached");
  verb->add_flag("--news", a.only_new, "Leave out what the server remembers");
  verb->add_flag("--json", a.json, "One JSON object per event and line");
  verb->footer(
      "Example:\n  fiducap events --server robot-hall:21600\n"
      "  fiducap events --news --json | jq 'select(.severity != \"info\")'");
}

}  // namespace fiducap
