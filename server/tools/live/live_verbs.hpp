#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "fiducap/client.hpp"
#include "fiducap/events.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

inline constexpr std::uint16_t kNativePort = 21600;

struct ServerAddress {
  std::string host;
  std::uint16_t port{};
};

/// @param text  HOST, HOST:PORT, [IPV6] or [IPV6]:PORT
/// @return Error when there is no host or the port is no number in 1..65535
[[nodiscard]] Expected<ServerAddress> parse_server_address(std::string_view text,
                                                           std::uint16_t default_port);

struct WatchArguments {
  std::string server{"127.0.0.1"};
  double duration_s{0};  ///< 0: until Ctrl-C.
  bool json{false};
};

/// `fiducap watch`: poses as a client receives them. A table that is redrawn on a terminal, one
/// line per body and second in a pipe, one JSON object per frame with --json.
/// @return exit code: failed when nothing arrived
[[nodiscard]] int run_watch(const WatchArguments& arguments, const Terminal& terminal);

/// Heading line, column names and one line per body; every line ends with a line break.
[[nodiscard]] std::string watch_table(const std::string& server, const Frame& frame,
                                      const ClientStatistics& statistics);
/// One line per body, for logs.
[[nodiscard]] std::string watch_lines(const Frame& frame, const ClientStatistics& statistics);
/// One JSON object in one line. Unknown values are null.
[[nodiscard]] std::string watch_json(const Frame& frame, const ClientStatistics& statistics);

struct EventsArguments {
  std::string server{"127.0.0.1"};
  std::optional<double> duration_s;  ///< nullopt: until interrupted.
  bool only_new{false};              ///< Without the events that the server remembers.
  bool json{false};                  ///< One JSON object per event and line.
};

/// `fiducap events`: the events of a server, until interrupted.
/// @return exit code: failed when the server was never reached
[[nodiscard]] int run_events(const EventsArguments& arguments, const Terminal& terminal);

/// `2026-01-31 12:00:00.123 error   drone: lost, … – do this`
[[nodiscard]] std::string event_line(const ServerEvent& event);
[[nodiscard]] std::string event_json(const ServerEvent& event);

struct ControlArguments {
  std::string server{"127.0.0.1"};
  std::string token;       ///< Empty: the environment's FIDUCAP_TOKEN.
  std::string body;        ///< Name or id.
  std::string name;        ///< New name of the body, of the recording or of the version.
  std::int64_t version{};  ///< Of the map.
  int tag_id{};
  std::string measured;  ///< File with measured places of tags.
  bool json{false};
  double timeout_s{10};  ///< While a recording's disk writes nothing.
};

/// `fiducap control list | record | stop`. @return exit code: failed when the server refused, with
/// its reason, and when a recording failed
[[nodiscard]] int run_control_list(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_record(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_stop(const ControlArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
