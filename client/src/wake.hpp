#pragma once

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

namespace fiducap::sdk {

/// Ends a `poll` of another thread.
class Wake {
 public:
  Wake() : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "fiducap: no eventfd");
  }
  ~Wake() { ::close(fd_); }
  Wake(const Wake&) = delete;
  Wake& operator=(const Wake&) = delete;

  void ring() {
    const std::uint64_t one = 1;
    // Fails only when 2^64-1 rings are pending, and then the poll ends anyway.
    if (::write(fd_, &one, sizeof(one)) < 0) return;
  }
  void drain() {
    std::uint64_t rings = 0;
    if (::read(fd_, &rings, sizeof(rings)) < 0) return;  // nothing pending
  }
  int descriptor() const { return fd_; }

 private:
  int fd_;
};

}  // namespace fiducap::sdk
