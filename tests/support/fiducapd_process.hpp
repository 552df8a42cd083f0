#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "support/temporary_folder.hpp"

namespace fiducap {

inline std::string demo_file() {
  return (std::filesystem::path(FIDUCAP_SOURCE_DIR) / "config" / "demo.yaml").string();
}

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
  boost::asio::io_context io;
  const boost::asio::ip::tcp::acceptor any(io, {boost::asio::ip::address_v4::loopback(), 0});
  return any.local_endpoint().port();
}

/// fiducapd with these arguments; its output goes to a file, or to `output` where one is given.
class FiducapdProcess final {
 public:
  explicit FiducapdProcess(std::vector<std::string> arguments, int output_to = -1) {
    arguments.insert(arguments.begin(),
                     (std::filesystem::path(FIDUCAP_BINARY_DIR) / "bin" / "fiducapd").string());
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
  [[nodiscard]] std::string output() const {
    std::ostringstream text;
    text << std::ifstream(folder_.file("output")).rdbuf();
    return text.str();
  }
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
