#pragma once

#include <functional>

#include "tools/terminal.hpp"

namespace CLI {
class App;
}

namespace fiducap {

/// Reads the arguments of `fiducap` and runs the verb.
/// @return exit code: 0 done, 1 failed, 2 wrong usage
[[nodiscard]] int run_command_line(int argc, const char* const* argv, const Terminal& terminal);

/// The verb that the command line names, to be run when all of it has been read. @return exit code
using ChosenVerb = std::function<int(const Terminal&)>;

// Each adds one verb with its options, or a group such as `control list`. `chosen` must outlive
// `app`.
void add_calibrate(CLI::App& app, ChosenVerb& chosen);
void add_cameras(CLI::App& app, ChosenVerb& chosen);
void add_capture(CLI::App& app, ChosenVerb& chosen);
void add_check(CLI::App& app, ChosenVerb& chosen);
void add_control(CLI::App& app, ChosenVerb& chosen);
void add_doctor(CLI::App& app, ChosenVerb& chosen);
void add_evaluate(CLI::App& app, ChosenVerb& chosen);
void add_events(CLI::App& app, ChosenVerb& chosen);
void add_import(CLI::App& app, ChosenVerb& chosen);
void add_map(CLI::App& app, ChosenVerb& chosen);
void add_replay(CLI::App& app, ChosenVerb& chosen);
void add_simulate(CLI::App& app, ChosenVerb& chosen);
void add_tags(CLI::App& app, ChosenVerb& chosen);
void add_watch(CLI::App& app, ChosenVerb& chosen);

// Below `fiducap calibrate` and `fiducap map`.
void add_calibrate_camera(CLI::App& calibrate, ChosenVerb& chosen);
void add_calibrate_extrinsics(CLI::App& calibrate, ChosenVerb& chosen);
void add_calibrate_imu(CLI::App& calibrate, ChosenVerb& chosen);
void add_map_build(CLI::App& map, ChosenVerb& chosen);
void add_map_edits(CLI::App& map, ChosenVerb& chosen);

}  // namespace fiducap
