#pragma once

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "support/temporary_folder.hpp"
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

/// Runs verbs that take these arguments.
template <typename Arguments>
class VerbTest : public testing::Test {
 protected:
  using Verb = int (*)(const Arguments&, const Terminal&);

  /// @return what the verb wrote to stdout
  std::string run(Verb verb, int exit_code = kExitOk) {
    const auto run =
        on_terminal([&](const Terminal& terminal) { return verb(arguments_, terminal); });
    EXPECT_EQ(run.code, exit_code) << run.err << run.out;
    err_ = run.err;
    return out_ = run.out;
  }
  /// @return why the verb failed
  std::string refused(Verb verb) {
    run(verb, kExitFailed);
    return err_;
  }

  TemporaryFolder folder_;
  Arguments arguments_;
  std::string out_, err_;
};

}  // namespace fiducap
