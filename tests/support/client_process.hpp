#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>
#include <vector>

extern char** environ;

namespace fiducap {

/// A child process, found by PATH, whose output is read without waiting. Ended with this object.
class ClientProcess final {
 public:
  explicit ClientProcess(std::vector<std::string> arguments) {
    int ends[2];
    EXPECT_EQ(::pipe2(ends, O_CLOEXEC | O_NONBLOCK), 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 2);
    // Without this the client would keep our port open.
    posix_spawn_file_actions_addclosefrom_np(&actions, 3);
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    EXPECT_EQ(::posix_spawnp(&pid_, argv[0], &actions, nullptr, argv.data(), environ), 0)
        << arguments[0];
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
    out_ = ends[0];
  }
  ~ClientProcess() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);  // some clients ignore others while they wait for a frame
      ::waitpid(pid_, nullptr, 0);
    }
    ::close(out_);
  }
  ClientProcess(const ClientProcess&) = delete;
  ClientProcess& operator=(const ClientProcess&) = delete;

  /// Its output so far, at most 4 MB.
  const std::string& output() {
    char buffer[65536];
    for (ssize_t n = 0; (n = ::read(out_, buffer, sizeof(buffer))) > 0;) {
      if (text_.size() < 4'000'000) text_.append(buffer, static_cast<std::size_t>(n));
    }
    return text_;
  }

 private:
  pid_t pid_{-1};
  int out_{-1};
  std::string text_;
};

}  // namespace fiducap
