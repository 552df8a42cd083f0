#include <cstdio>
#include <exception>
#include <iostream>

#include <unistd.h>

#include "base/log.hpp"
#include "tools/command_line.hpp"

int main(int argc, char** argv) {
  const fiducap::Terminal terminal{std::cout, std::cerr, ::isatty(STDOUT_FILENO) == 1,
                                   ::isatty(STDERR_FILENO) == 1};
  fiducap::log::set_level(fiducap::log::Level::kWarning);
  try {
    return fiducap::run_command_line(argc, argv, terminal);
  } catch (const std::exception& bug) {
    std::cerr << "fiducap: unexpected failure: " << bug.what() << std::endl;
    return fiducap::kExitFailed;
  }
}
