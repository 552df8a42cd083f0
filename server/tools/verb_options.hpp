#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "tools/command_line.hpp"

namespace fiducap {

/// For options that are lengths, times or factors.
inline const CLI::Validator kPositive(
    [](std::string& text) {
      double value = 0;
      const bool good = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value > 0;
      return good ? std::string() : "must be a number > 0, is '" + text + "'";
    },
    "NUMBER>0");

/// Arguments of a verb, for its options to write into; `run(arguments, terminal)` is called when
/// the verb is chosen. @return owned by the verb
template <class Arguments, class Run>
Arguments& arguments_of(CLI::App& verb, ChosenVerb& chosen, Run run) {
  const auto arguments = std::make_shared<Arguments>();
  verb.callback([arguments, run, &chosen] {
    chosen = [arguments, run](const Terminal& terminal) { return run(*arguments, terminal); };
  });
  return *arguments;
}

/// A length, time or factor. Its default is shown when it is > 0; 0 means that it is not given.
inline CLI::Option* add_positive(CLI::App& verb, const char* name, double& value,
                                 const char* what) {
  auto* option = verb.add_option(name, value, what)->check(kPositive);
  return value > 0 ? option->capture_default_str() : option;
}

inline void add_server_option(CLI::App& verb, std::string& server) {
  verb.add_option("--server", server, "HOST or HOST:PORT of the native protocol")
      ->capture_default_str();
}

inline void add_set_option(CLI::App& verb, std::vector<std::string>& sets) {
  verb.add_option("--set", sets,
                  "Override one key of the configuration; may be given several times")
      ->allow_extra_args(false);
}

inline void add_filter_option(CLI::App& verb, std::string& filter) {
  verb.add_option("--filter", filter, "Which filter")
      ->check(CLI::IsMember({"robocentric", "world"}));
}

}  // namespace fiducap
