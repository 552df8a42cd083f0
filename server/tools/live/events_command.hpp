#pragma once

#include <optional>
#include <string>

#include "fiducap/events.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct EventsArguments {
  std::string server{"127.0.0.1"};   ///< HOST or HOST:PORT of the native protocol.
  std::optional<double> duration_s;  ///< Nothing: until interrupted.
  bool news{false};                  ///< Not what the server remembers.
  bool json{false};                  ///< One JSON object per event and line.
};

/// `2026-01-31 12:00:00.123 error   drone: lost, … – do this`
[[nodiscard]] std::string event_line(const ServerEvent& event);
[[nodiscard]] std::string event_json(const ServerEvent& event);

/// `fiducap events`: what happens at a server, until interrupted.
/// @return exit code: failed when the server was never reached
[[nodiscard]] int run_events(const EventsArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
