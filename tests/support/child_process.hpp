#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "support/temporary_folder.hpp"

namespace fiducap {

/// A child process in the network of the calling thread. Its output goes to a file, or to
/// `output_to` where one is given. Killed with this object.
class ChildProcess {
 public:
  /// @param arguments  the program first, found by PATH
  explicit ChildProcess(std::vector<std::string> arguments, int output_to = -1) {
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const std::string file = folder_.file("output");
    pid_ = ::fork();
    if (pid_ != 0) return;
    const int output =
        output_to >= 0 ? output_to : ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(output, STDOUT_FILENO);
    ::dup2(output, STDERR_FILENO);
    ::close_range(STDERR_FILENO + 1, ~0U, 0);  // otherwise it would keep our ports open
    ::execvp(argv[0], argv.data());
    ::_exit(127);
  }
  ~ChildProcess() {
    if (pid_ > 0) ::kill(pid_, SIGKILL), ::waitpid(pid_, nullptr, 0);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Waits for its end.
  int exit_code() {
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] bool is_running() const {
    siginfo_t info{};
    return pid_ > 0 &&
           ::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid == 0;
  }
  void signal(int number) const { ::kill(pid_, number); }
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] std::string output() const {
    std::ifstream file(folder_.file("output"), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  /// Waits for a text, at most 15 s.
  [[nodiscard]] bool prints(const std::string& text) const {
    for (int i = 0; i < 300; ++i) {
      if (output().find(text) != std::string::npos) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return false;
  }

 private:
  TemporaryFolder folder_;
  pid_t pid_{-1};
};

}  // namespace fiducap
