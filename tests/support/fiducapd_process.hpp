#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "support/loopback_socket.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {

inline std::string demo_file() { return FIDUCAP_SOURCE_DIR "/config/demo.yaml"; }

/// For the demo: ready corners instead of images (a thousandth of the cost).
inline std::vector<std::string> corners_on_free_ports() {
  return {"--set", "streaming.vrpn.port=0",
          "--set", "streaming.native.port=0",
          "--set", "streaming.web.port=0",
          "--set", "bodies.0.source.camera.images=false",
          "--set", "bodies.1.source.camera.images=false",
          "--set", "bodies.2.source.camera.images=false"};
}

inline std::uint16_t free_port() {
  const int any = bound_socket(SOCK_STREAM);
  const std::uint16_t port = port_of(any);
  ::close(any);
  return port;
}

/// fiducapd with these arguments; its output goes to a file, or to `output` where one is given.
class FiducapdProcess final {
 public:
  explicit FiducapdProcess(std::vector<std::string> arguments, int output_to = -1) {
    arguments.insert(arguments.begin(), FIDUCAP_BINARY_DIR "/bin/fiducapd");
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
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ~FiducapdProcess() {
    if (pid_ > 0) ::kill(pid_, SIGKILL), ::waitpid(pid_, nullptr, 0);
  }
  FiducapdProcess(const FiducapdProcess&) = delete;
  FiducapdProcess& operator=(const FiducapdProcess&) = delete;

  int exit_code() {
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  void signal(int number) const { ::kill(pid_, number); }
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] std::string output() const { return content_of(folder_.file("output")); }
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
