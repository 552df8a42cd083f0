#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <utility>

namespace fiducap {

/// A file that blocks its writer until `thaw`, as on a disk that does not answer.
class FrozenFile final {
 public:
  explicit FrozenFile(std::string path) : path_(std::move(path)) {
    std::signal(SIGPIPE, SIG_IGN);  // as in the server
    std::filesystem::create_directories(std::filesystem::path(path_).parent_path());
    EXPECT_EQ(::mkfifo(path_.c_str(), 0600), 0) << path_;
  }
  ~FrozenFile() {
    thaw();
    ::close(reader_);
  }
  FrozenFile(const FrozenFile&) = delete;
  FrozenFile& operator=(const FrozenFile&) = delete;
  void thaw() {
    if (reader_ < 0) reader_ = ::open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  }

 private:
  std::string path_;
  int reader_{-1};
};

}  // namespace fiducap
