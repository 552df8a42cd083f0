#include "tools/command_line.hpp"

#include <string>

#include <CLI/CLI.hpp>

#include "detection/tag_family_list.hpp"
#include "tools/calibrate/calibrate_verbs.hpp"
#include "tools/camera/camera_verbs.hpp"
#include "tools/doctor/doctor_command.hpp"
#include "tools/import/import_command.hpp"
#include "tools/live/control_command.hpp"
#include "tools/live/events_command.hpp"
#include "tools/live/watch_command.hpp"
#include "tools/map_verbs.hpp"
#include "tools/positive_number.hpp"
#include "tools/replay/check_command.hpp"
#include "tools/replay/evaluate_command.hpp"
#include "tools/replay/replay_command.hpp"
#include "tools/replay/simulate_command.hpp"
#include "tools/tags/tags_command.hpp"
#include "tools/wrong_words.hpp"

namespace fiducap {
namespace {

/// The arguments of all verbs and what is to be run.
struct CommandLine {
  ReplayArguments replay;
  CheckArguments check;
  EvaluateArguments evaluate;
  WatchArguments watch;
  EventsArguments events;
  DoctorArguments doctor;
  ControlArguments control;
  MapVerbs map;
  TagSheetArguments tag_sheet;
  CalibrateArguments calibrate;
  CameraArguments camera;
  ImportArguments import_arguments;
  SimulateArguments simulate;
  ChosenVerb chosen;
};

void add_replay(CLI::App& app, CommandLine& line) {
  auto* verb = app.add_subcommand(
      "replay", "Run a recording through the filter, offline, as fast as the machine allows");
  auto& a = line.replay;
  verb->add_option("RECORDING", a.recordings,
                   "Folders in the EuRoC/ASL layout (mav0/cam0, mav0/imu0, mav0/tags0 …), or one "
                   "session of fiducapd")
      ->required();
  verb->add_option("--out", a.out,
                   "Folder for <recording>.tum and .covariance.csv, map.csv, extrinsics.yaml, "
                   "events.csv, report.json and plots.html; an earlier run in it is replaced")
      ->required();
  verb->add_flag("--together", a.together,
                 "Several recordings as several robots, in order of time, over one live map");
  verb->add_option(
      "--config", a.config,
      "Take the sections estimator, detector, tags and map.reference_* of a server configuration");
  verb->add_option("--map", a.map, "Tags whose places are known: .yaml, .csv");
  verb->add_option(
      "--store", a.store,
      "The newest version in this map store is where the map begins. With --resolve it "
      "must not have been made of these recordings: what they saw would count twice");
  verb->add_flag(
      "--resolve", a.resolve,
      "Solve for all poses and tags together after the last image: each pose by what was "
      "seen before and after it, with its covariance. One recording without an IMU is "
      "always resolved");
  verb->add_option("--filter", a.filter, "Which filter")
      ->check(CLI::IsMember({"robocentric", "world"}));
  verb->add_option("--set", a.sets,
                   "Override one key of the configuration; may be given several times")
      ->allow_extra_args(false);
  verb->add_flag("--anyway", a.anyway, "Run also what `fiducap check` calls unusable");
  verb->add_flag("!--no-plots", a.plots, "Leave plots.html out");
  verb->add_flag("--json", a.json, "Print report.json instead of words");
  verb->footer(
      "Example:\n"
      "  fiducap replay recordings/hall --out results --set estimator.corner_noise_px=0.3\n"
      "  fiducap evaluate results/hall.tum recordings/hall\n"
      "  fiducap replay drone rover arm --together --out results\n"
      "  fiducap replay recordings/hall --resolve --out results");
  verb->callback([&] { line.chosen = [&](const Terminal& t) { return run_replay(a, t); }; });
}

void add_check(CLI::App& app, CommandLine& line) {
  auto* verb = app.add_subcommand(
      "check", "Can this recording be used? Stamps, clocks, units of the IMU, order of corners");
  verb->add_option("RECORDING", line.check.recordings, "Folders in the EuRoC/ASL layout")
      ->required();
  verb->add_flag("--json", line.check.json, "One JSON object for scripts");
  verb->footer("Fails when a recording is unusable.\nExample:\n  fiducap check recordings/hall");
  verb->callback(
      [&line] { line.chosen = [&line](const Terminal& t) { return run_check(line.check, t); }; });
}

void add_evaluate(CLI::App& app, CommandLine& line) {
  auto* verb = app.add_subcommand("evaluate",
                                  "Errors of a replay against the recording's truth or reference");
  auto& a = line.evaluate;
  verb->add_option(
          "TUM", a.tum,
          "The replay's <recording>.tum; map.csv and extrinsics.yaml are read from beside it")
      ->required();
  verb->add_option("RECORDING", a.recording, "The recording it was made from")->required();
  verb->add_option("--plot", a.plot,
                   "Draw errors, map and reprojection: .html (one page) or .svg (the pictures)");
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Poses are compared in the axes of the reference tag, nothing is fitted, the first 5 s are "
      "left out.\n"
      "Example:\n  fiducap evaluate results/hall.tum recordings/hall --json\n"
      "  fiducap evaluate results/hall.tum recordings/hall --plot hall.html");
  verb->callback([&] { line.chosen = [&](const Terminal& t) { return run_evaluate(a, t); }; });
}

void add_watch(CLI::App& app, CommandLine& line) {
  auto* verb =
      app.add_subcommand("watch", "Live poses, rates, latency and loss as a client receives them");
  auto& a = line.watch;
  verb->add_option("--server", a.server, "HOST or HOST:PORT of the native protocol")
      ->capture_default_str();
  verb->add_option("--duration", a.duration_s,
                   "End after this many seconds; fails when nothing arrived")
      ->check(kPositive);
  verb->add_flag("--json", a.json, "One JSON object per frame and line");
  verb->footer(
      "Example:\n  fiducap watch --server robot-hall:21600\n"
      "  fiducap watch --json --duration 10 | jq '.bodies[0].position_m'");
  verb->callback([&] { line.chosen = [&](const Terminal& t) { return run_watch(a, t); }; });
}

void add_events(CLI::App& app, CommandLine& line) {
  auto* verb = app.add_subcommand(
      "events", "What happens at a server: bodies lost and found, devices, disks, clocks");
  auto& a = line.events;
  verb->add_option("--server", a.server, "HOST or HOST:PORT of the native protocol")
      ->capture_default_str();
  verb->add_option("--duration", a.duration_s,
                   "End after this many seconds; fails when the server was never reached")
      ->check(kPositive);
  verb->add_flag("--news", a.news, "Leave out what the server remembers");
  verb->add_flag("--json", a.json, "One JSON object per event and line");
  verb->footer(
      "Example:\n  fiducap events --server robot-hall:21600\n"
      "  fiducap events --news --json | jq 'select(.severity != \"info\")'");
  verb->callback([&] { line.chosen = [&](const Terminal& t) { return run_events(a, t); }; });
}

void add_doctor(CLI::App& app, CommandLine& line) {
  auto* verb = app.add_subcommand(
      "doctor",
      "Why does a client see nothing, what is wrong with a server? Network, ports, exposure, "
      "machine, disks, bodies, alarms");
  auto& a = line.doctor;
  verb->add_option("--config", a.config, "The server's configuration; without it the defaults");
  verb->add_option("--set", a.sets,
                   "Override one key of the configuration; may be given several times")
      ->allow_extra_args(false);
  verb->add_option("--server", a.server, "HOST or HOST:PORT of the native protocol")
      ->capture_default_str();
  verb->add_flag("--json", a.json, "One JSON object for scripts");
  verb->footer("Example:\n  fiducap doctor --config config/demo.yaml");
  verb->callback([&] { line.chosen = [&](const Terminal& t) { return run_doctor(a, t); }; });
}

using ControlVerb = int (*)(const ControlArguments&, const Terminal&);

CLI::App* add_control_verb(CLI::App& control, CommandLine& line, const char* name, const char* what,
                           ControlVerb run, const char* example = "") {
  auto* verb = control.add_subcommand(name, what);
  verb->add_option("--server", line.control.server, "HOST or HOST:PORT of the native protocol")
      ->capture_default_str();
  verb->add_option(
      "--token", line.control.token,
      "The operator's token; better the environment's FIDUCAP_TOKEN: every user of the "
      "machine sees command lines");
  verb->callback([&line, run] {
    line.chosen = [&line, run](const Terminal& t) { return run(line.control, t); };
  });
  verb->footer("Example:\n  fiducap control " + std::string(name) + std::string(example));
  return verb;
}

void add_control_map(CLI::App& control, CommandLine& line) {
  auto& a = line.control;
  add_control_verb(control, line, "commit", "Store the map now", run_control_commit,
                   " before-the-move")
      ->add_option("NAME", a.name, "What the history shall call the version");
  const auto for_version = [&](const char* name, const char* what, ControlVerb run,
                               const char* example) {
    auto* verb = add_control_verb(control, line, name, what, run, example);
    verb->add_option("VERSION", a.version, "Its number, as the page and fiducap map log say")
        ->required();
    return verb;
  };
  for_version("name", "Name a stored version of the map: it is kept then", run_control_name,
              " 12 before-the-move")
      ->add_option("NAME", a.name, "1 to 200 characters")
      ->required();
  for_version("rollback", "Serve a stored version of the map again, as a new version",
              run_control_rollback, " 12");
  add_control_verb(control, line, "align",
                   "Say where the workspace lies in the room; what is streamed jumps into its axes",
                   run_control_align, " --to measured.csv")
      ->add_option("--to", a.measured,
                   "Three tags or more as measured in the room: id,x,y,z in metres, z up")
      ->required();
  const auto for_tag = [&](const char* name, const char* what, ControlVerb run) {
    add_control_verb(control, line, name, what, run, " 7")
        ->add_option("TAG", a.tag_id, "Its id")
        ->required()
        ->check(CLI::NonNegativeNumber);
  };
  for_tag("quarantine", "Keep a tag in the map and use it no more", run_control_quarantine);
  for_tag("forget", "Know nothing of a tag: seen again, it is a new one", run_control_forget);
}

void add_control(CLI::App& app, CommandLine& line) {
  auto* control = app.add_subcommand("control", "Change a running server: bodies, map, recording");
  control->require_subcommand(1);
  control->footer(
      "The server's configuration names the token: operator.token or operator.token_file.\n"
      "Other users of this machine see command lines, but not the environment.\n"
      "Before: export FIDUCAP_TOKEN=$(cat robot.token)\n"
      "Example:\n  fiducap control disable rover\n"
      "  fiducap control record flight-3");
  auto& a = line.control;
  add_control_verb(*control, line, "list", "Bodies, map mode, recording", run_control_list)
      ->add_flag("--json", a.json, "One JSON object");
  const auto for_body = [&](const char* name, const char* what, ControlVerb run,
                            const char* example = " rover") {
    auto* verb = add_control_verb(*control, line, name, what, run, example);
    verb->add_option("BODY", a.body, "Its name or id")->required();
    return verb;
  };
  for_body("enable", "Stream a body again", run_control_enable);
  for_body("disable", "Stream a body no more; it is followed on", run_control_disable);
  for_body("rename", "Give a body another name until the server ends", run_control_rename,
           " rover scout")
      ->add_option("NAME", a.name, "letters of any script, digits, spaces, _ - . + ( )")
      ->required();
  add_control_verb(*control, line, "freeze", "The map moves no more", run_control_freeze);
  add_control_verb(*control, line, "map", "The map grows and is refined", run_control_map);
  add_control_map(*control, line);
  const auto for_recording = [&](const char* name, const char* what, ControlVerb run) {
    auto* verb = add_control_verb(*control, line, name, what, run);
    verb->add_option("--patience", a.patience_s,
                     "Seconds to wait for a disk that takes nothing of the recording")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    return verb;
  };
  for_recording("record", "Record the sensors of all bodies", run_control_record)
      ->add_option("NAME", a.name, "Of the folder; without it the date and time");
  for_recording("stop", "End the recording, and say what is on disk", run_control_stop);
}

void add_tags(CLI::App& app, CommandLine& line) {
  auto* tags = app.add_subcommand("tags", "Tags to print");
  tags->require_subcommand(1);
  tags->footer("Example:\n  fiducap tags sheet --ids 0-11 --size-mm 160 --paper a4 --out tags.pdf");
  auto* verb = tags->add_subcommand(
      "sheet",
      "A PDF with tags of exact size, cut marks and a ruler, and their sizes as YAML beside it");
  auto& a = line.tag_sheet;
  verb->add_option("--ids", a.ids, "Ids and ranges, e.g. 0-3,7")->capture_default_str();
  verb->add_option("--size-mm", a.size_mm, "Edge between black and white border")
      ->check(kPositive)
      ->capture_default_str();
  verb->add_option("--paper", a.paper, "a4, a3 or letter")
      ->check(CLI::IsMember({"a4", "a3", "letter"}))
      ->capture_default_str();
  verb->add_option("--family", a.family, "Tag family: " + tag_family_names())
      ->capture_default_str();
  verb->add_option("--out", a.out, "The PDF")->capture_default_str();
  verb->add_flag("--json", a.json, "One JSON object for scripts");
  verb->footer(
      "Print at 100 %, then measure the ruler on the sheet.\n"
      "Example:\n  fiducap tags sheet --ids 0-11 --size-mm 160 --paper a4 --out tags.pdf");
  verb->callback([&] { line.chosen = [&](const Terminal& t) { return run_tag_sheet(a, t); }; });
}

void add_simulate(CLI::App& app, CommandLine& line) {
  auto* verb = app.add_subcommand("simulate", "Write a recording of a simulated robot, with truth");
  auto& a = line.simulate;
  verb->add_option("--out", a.out, "New folder for the recording")->required();
  verb->add_option("--room", a.room, "hall, table, sparse, loop or ceiling")
      ->check(CLI::IsMember({"hall", "table", "sparse", "loop", "ceiling"}))
      ->capture_default_str();
  verb->add_option("--seconds", a.seconds, "Length")->check(kPositive)->capture_default_str();
  verb->add_option("--seed", a.seed, "Same seed, same recording")->capture_default_str();
  verb->add_option("--speed", a.speed, "Scales the time of the motion")
      ->check(kPositive)
      ->capture_default_str();
  verb->add_option("--corner-noise-px", a.corner_noise_px,
                   "With --corners: 1-sigma of each coordinate")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  verb->add_option("--gravity", a.gravity_m_s2, "Where it is, m/s²; the recording does not tell it")
      ->check(kPositive)
      ->capture_default_str();
  auto* images = verb->add_flag("--images", a.images, "Render images");
  verb->add_flag("--corners", a.corners, "Corners only (the default): a thousand times quicker")
      ->excludes(images);
  verb->add_flag("!--no-imu", a.imu, "A robot without IMU");
  verb->add_flag("--json", a.json, "One JSON object for scripts");
  verb->footer(
      "Example:\n  fiducap simulate --out recordings/table --room table --seconds 60 --seed 7");
  verb->callback([&] { line.chosen = [&](const Terminal& t) { return run_simulate(a, t); }; });
}

}  // namespace

int run_command_line(int argc, const char* const* argv, const Terminal& terminal) {
  CLI::App app("Fiducap: motion capture from printed tags, spoken in every mocap dialect.",
               "fiducap");
  CommandLine line;
  app.set_version_flag("--version", FIDUCAP_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 done, 1 failed, 2 wrong usage. `fiducap VERB --help` shows an example of each "
      "verb.\n"
      "Example:\n"
      "  fiducap simulate --out recordings/table --room table\n"
      "  fiducap replay recordings/table --out results\n"
      "  fiducap evaluate results/table.tum recordings/table");
  add_watch(app, line);
  add_events(app, line);
  add_doctor(app, line);
  add_control(app, line);
  add_import(app, line.import_arguments, line.chosen);
  add_check(app, line);
  add_replay(app, line);
  add_evaluate(app, line);
  add_map(app, line.map, line.chosen);
  add_tags(app, line);
  add_camera_verbs(app, line.camera, line.chosen);
  add_calibrate(app, line.calibrate, line.chosen);
  add_simulate(app, line);
  if (const auto wrong = wrong_word(app, argc, argv)) {
    terminal.err << *wrong << "\n";
    return kExitUsage;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem, terminal.out, terminal.err) == 0 ? kExitOk : kExitUsage;
  }
  const int code = line.chosen(terminal);
  if (terminal.out.flush()) return code;
  terminal.err << "fiducap: standard output could not be written: is the disk full?\n";
  return code == kExitOk ? kExitFailed : code;
}

}  // namespace fiducap
