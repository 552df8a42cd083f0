#include "tools/command_line.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/text.hpp"

namespace fiducap {
namespace {

/// In the order of the help.
constexpr std::array kVerbs{add_watch,   add_events,  add_doctor,    add_control, add_import,
                            add_check,   add_replay,  add_evaluate,  add_map,     add_tags,
                            add_cameras, add_capture, add_calibrate, add_simulate};

std::vector<std::string> verbs_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* verb : app.get_subcommands({})) names.push_back(verb->get_name());
  return names;
}

/// Long options only.
std::vector<std::string> options_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options({}))
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

/// A verb or an option that does not exist, with the one that was probably meant: CLI11 would
/// report unexpected or missing arguments instead. @return the message; nullopt: all of them exist
std::optional<std::string> wrong_word(const CLI::App& app, int argc, const char* const* argv) {
  const CLI::App* at = &app;
  std::string path = app.get_name();
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto verbs = verbs_of(*at);
    if (word == "--") return std::nullopt;  // no options after it
    if (word.starts_with("--")) {
      const auto options = options_of(*at);
      const std::string name = word.substr(0, word.find('='));
      if (std::ranges::find(options, name) != options.end()) continue;
      const std::string meant = did_you_mean(name, options);
      return path + " " + name + ": there is no such option; " +
             (meant.empty() ? "`" + path + " --help` lists them" : meant);
    }
    if (word.empty() || word.front() == '-' || verbs.empty()) continue;
    if (std::ranges::find(verbs, word) == verbs.end())
      return path + " " + word + ": there is no such verb; it " + must_be_one_of(verbs, word);
    at = at->get_subcommand(word);
    path += " " + word;
  }
  return std::nullopt;
}

}  // namespace

int run_command_line(int argc, const char* const* argv, const Terminal& terminal) {
  CLI::App app(
      "Fiducap: motion capture from printed tags, with the protocols of common mocap systems.",
      "fiducap");
  ChosenVerb chosen;
  app.set_version_flag("--version", FIDUCAP_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 done, 1 failed, 2 wrong usage. `fiducap VERB --help` shows an example of each "
      "verb.\n"
      "Example:\n"
      "  fiducap simulate --out recordings/table --room table\n"
      "  fiducap replay recordings/table --out results\n"
      "  fiducap evaluate results/table.tum recordings/table");
  for (const auto add : kVerbs) add(app, chosen);
  if (const auto wrong = wrong_word(app, argc, argv)) {
    terminal.err << *wrong << "\n";
    return kExitUsage;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem, terminal.out, terminal.err) == 0 ? kExitOk : kExitUsage;
  }
  const int code = chosen(terminal);
  if (terminal.out.flush()) return code;
  terminal.err << "fiducap: standard output could not be written: is the disk full?\n";
  return code == kExitOk ? kExitFailed : code;
}

}  // namespace fiducap
