#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace fiducap::dds {

/// What the other vendor's subscriber printed about one topic.
struct Heard {
  int count{};         ///< Messages.
  int ids{};           ///< Different keys.
  int incompatible{};  ///< QoS policy that did not fit; 0: none.
  std::string last;    ///< The newest message.
};

/// `fast_dds_peer` as a child process in the network of the calling thread. Its output is read when
/// it ends.
class PeerProcess final {
 public:
  explicit PeerProcess(std::vector<std::string> arguments) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) return;
    std::string program = FAST_DDS_PEER;
    std::vector<char*> argv{program.data()};
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(ends[1], STDOUT_FILENO);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
    ::close(ends[1]);
    output_ = ends[0];
  }
  ~PeerProcess() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
    if (output_ >= 0) ::close(output_);
  }
  PeerProcess(const PeerProcess&) = delete;
  PeerProcess& operator=(const PeerProcess&) = delete;

  [[nodiscard]] bool is_running() {
    siginfo_t info{};
    return pid_ > 0 &&
           ::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid == 0;
  }
  /// Waits for its end. By topic, as on the wire.
  [[nodiscard]] std::map<std::string, Heard> heard() {
    std::ostringstream text;
    char buffer[4096];
    for (ssize_t n = 0; (n = ::read(output_, buffer, sizeof(buffer))) > 0;) text.write(buffer, n);
    std::map<std::string, Heard> all;
    std::istringstream lines(text.str());
    for (std::string line; std::getline(lines, line);) {
      const auto last = line.find("last: ");
      if (last == std::string::npos) continue;
      const auto number = [&line](const std::string& key) {
        const auto at = line.find(key + "=");
        return at == std::string::npos ? 0 : std::atoi(line.c_str() + at + key.size() + 1);
      };
      all[line.substr(0, line.find(' '))] = {number("count"), number("ids"), number("incompatible"),
                                             line.substr(last + 6)};
    }
    return all;
  }

 private:
  pid_t pid_{-1};
  int output_{-1};
};

}  // namespace fiducap::dds
