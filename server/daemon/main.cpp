// fiducapd: sensors in, mocap streams out. Exit codes: 0 ok, 1 failed, 2 usage or configuration,
// 3 given up because frames were not delivered any more.
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <optional>
#include <utility>

#include "base/log.hpp"
#include "base/text.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/operator_token.hpp"
#include "daemon/review/config_review.hpp"
#include "daemon/server.hpp"
#include "daemon/setup/setup_files.hpp"
#include "daemon/system.hpp"

namespace {

int complain(const std::vector<fiducap::ConfigFault>& faults) {
  for (const auto& fault : faults) std::cerr << fiducap::printable(fault.text()) << "\n";
  return faults.empty() ? 0 : 2;
}

/// Prints faults, doubts and the plan of a configuration. @return exit code
int report(const fiducap::ConfigReview& review, bool as_json) {
  if (as_json) {
    if (!(std::cout << fiducap::review_json(review) << std::endl)) return 1;
    return review.faults.empty() ? 0 : 2;
  }
  for (const auto& fault : review.faults)
    std::cerr << "wrong     " << fiducap::printable(fault.text()) << "\n";
  for (const auto& doubt : review.doubts)
    std::cerr << "doubtful  " << fiducap::printable(doubt.text()) << "\n";
  if (!review.faults.empty()) return 2;
  for (const auto& line : review.plan)
    std::cout << "will run  " << fiducap::printable(line) << "\n";
  return std::cout.flush() ? 0 : 1;
}

/// @return exit code; nullopt: a configuration was written and is to be served
std::optional<int> serve(fiducap::ServerConfig config, fiducap::ServerOptions options) {
  auto operators = fiducap::with_tokens(config.operators, std::getenv("CREDENTIALS_DIRECTORY"));
  if (!operators) {
    std::cerr << fiducap::printable(operators.error().text()) << "\n";
    return 2;
  }
  config.operators = std::move(*operators);
  options.stop_on_signals = true;
  options.give_up = [] {
    fiducap::log::flush(std::chrono::milliseconds(500));
    std::_Exit(3);
  };
  const fiducap::SystemClock clock;
  ::umask(::umask(0) | 0027);     // maps and recordings are the lab's, not the world's
  std::signal(SIGPIPE, SIG_IGN);  // the reader of the log may end
  std::signal(SIGXFSZ, SIG_IGN);  // handled like a full disk
  fiducap::log::set_level(config.log_level);
  auto server = fiducap::Server::build(config, options, clock);
  if (!server) {
    fiducap::log::error("daemon", server.error().text());
    return 1;
  }
  const auto end = (*server)->run();
  if (end == fiducap::ServerEnd::kClean) return 0;
  if (end == fiducap::ServerEnd::kSetUp) return std::nullopt;
  fiducap::log::flush(std::chrono::milliseconds(500));
  std::_Exit(end == fiducap::ServerEnd::kLost ? 1 : 0);  // without waiting for blocked threads
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Fiducap server: motion capture from printed tags."};
  std::string file, setup;
  std::vector<std::string> sets;
  bool simulated = false;
  bool exit_at_end = false, check = false, print = false, as_json = false;
  auto* config_file = app.add_option("--config", file, "configuration, YAML");
  auto* setup_file =
      app.add_option("--setup", setup,
                     "write this configuration with the help of the page, then serve it")
          ->excludes(config_file);
  app.add_flag("--simulated", simulated,
               "with --setup: offer a simulated robot beside this machine's cameras")
      ->needs(setup_file);
  app.add_option("--set", sets, "path.to.key=value, before checking; list entries by number")
      ->allow_extra_args(false);
  auto* checking = app.add_flag("--check-config", check,
                                "open all files, devices and ports of the configuration, print "
                                "what is wrong, doubtful and would run, and end")
                       ->excludes(setup_file);
  app.add_flag("--json", as_json, "with --check-config: for scripts")->needs(checking);
  app.add_flag("--print-config", print, "write the effective configuration, and end")
      ->excludes(setup_file);
  app.add_flag("--exit-at-end", exit_at_end, "end when every source has ended");
  app.set_version_flag("--version", FIDUCAP_VERSION);
  try {
    app.parse(argc, argv);
    if (file.empty() && setup.empty()) throw CLI::RequiredError("--config or --setup");
    if (!setup.empty()) {
      if (const auto can = fiducap::can_write_setup(setup); !can) {
        std::cerr << fiducap::printable(can.error().text()) << "\n";
        return 2;
      }
      auto pages = fiducap::load_config("", sets);  // nothing else is served before it is written
      if (!pages) return complain(pages.error());
      pages->streaming.vrpn.enabled = pages->streaming.native.enabled = false;
      fiducap::ServerOptions options;
      options.setup = fiducap::SetupOptions{setup, simulated};
      if (const auto code = serve(std::move(*pages), options)) return *code;
      file = setup;
    }
    auto config = fiducap::load_config(file, sets);
    if (!config && check) return report({config.error(), {}, {}}, as_json);
    if (!config) return complain(config.error());
    if (print) return std::cout << fiducap::print_config(*config) << std::flush ? 0 : 1;
    if (check) return report(fiducap::review(*config), as_json);
    fiducap::ServerOptions options;
    options.exit_at_end = exit_at_end;
    return *serve(std::move(*config), options);
  } catch (const CLI::ParseError& wrong) {
    return app.exit(wrong) == 0 ? 0 : 2;
  } catch (const std::exception& failure) {
    std::cerr << "fiducapd: " << failure.what() << "\n";
    return 1;
  }
}
