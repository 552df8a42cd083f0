#include <exception>
#include <iostream>

#include <sys/stat.h>
#include <unistd.h>

#include "base/log.hpp"
#include "tools/command_line.hpp"

int main(int argc, char** argv) {
  const bool out_is_live = ::isatty(STDOUT_FILENO) == 1;
  fiducap::PrintableOutput printable_out(std::cout);
  fiducap::PrintableOutput printable_err(std::cerr);
  std::ostream out(out_is_live ? static_cast<std::streambuf*>(&printable_out) : std::cout.rdbuf());
  std::ostream err(&printable_err);
  err << std::unitbuf;
  const fiducap::Terminal terminal{out, err, out_is_live, ::isatty(STDERR_FILENO) == 1};
  ::umask(::umask(0) | 0027);  // maps and recordings are not for other users
  fiducap::log::set_level(fiducap::log::Level::kWarning);
  try {
    return fiducap::run_command_line(argc, argv, terminal);
  } catch (const std::exception& bug) {
    err << "fiducap: unexpected failure: " << bug.what() << std::endl;
    return fiducap::kExitFailed;
  }
}
