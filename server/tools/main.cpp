#include <exception>
#include <iostream>

#include <sys/stat.h>
#include <unistd.h>

#include "base/log.hpp"
#include "tools/command_line.hpp"

int main(int argc, char** argv) {
  const fiducap::Terminal terminal{std::cout, std::cerr, ::isatty(STDOUT_FILENO) == 1,
                                   ::isatty(STDERR_FILENO) == 1};
  ::umask(::umask(0) | 0027);  // maps and recordings are not for other users
  fiducap::log::set_level(fiducap::log::Level::kWarning);
  try {
    return fiducap::run_command_line(argc, argv, terminal);
  } catch (const std::exception& bug) {
    std::cerr << "fiducap: unexpected failure: " << bug.what() << std::endl;
    return fiducap::kExitFailed;
  }
}
