#pragma once

#include <sstream>
#include <string>
#include <vector>

#include "tools/command_line.hpp"

namespace fiducap {

/// What a verb of `fiducap` wrote, and its exit code.
struct CommandRun {
  int code{};
  std::string out;
  std::string err;
};

/// Calls `verb` with a terminal that is kept as text.
template <typename Verb>
CommandRun on_terminal(Verb&& verb) {
  std::ostringstream out, err;
  const int code = verb(Terminal{out, err});
  return {code, out.str(), err.str()};
}

/// `fiducap` with these arguments, in this process.
inline CommandRun run_fiducap(const std::vector<std::string>& arguments) {
  std::vector<const char*> argv{"fiducap"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  return on_terminal([&](const Terminal& terminal) {
    return run_command_line(static_cast<int>(argv.size()), argv.data(), terminal);
  });
}

}  // namespace fiducap
