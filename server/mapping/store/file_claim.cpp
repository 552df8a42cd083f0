#include "mapping/store/file_claim.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace fiducap {

namespace {

/// Written by the process that has the lock, for messages only.
std::string holder_of(int file) {
  std::array<char, 32> text{};
  const ssize_t size = ::pread(file, text.data(), text.size() - 1, 0);
  return size > 0 ? "process " + std::string(text.data(), static_cast<std::size_t>(size))
                  : "another process";
}

/// The same lock for all names of the file.
std::string lock_of(const std::string& path) {
  std::error_code unknown;
  const auto real = std::filesystem::weakly_canonical(path, unknown);
  return (unknown ? path : real.string()) + ".lock";
}

}  // namespace

Expected<FileClaim> FileClaim::take(const std::string& path) {
  const std::string lock = lock_of(path);
  const int file = ::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0640);
  if (file < 0)
    return fail(ErrorCode::kUnavailable,
                std::string("cannot be opened (") + std::strerror(errno) +
                    "): the folder must be writable, and the file must belong to the server's user",
                lock);
  FileClaim claim(file);
  if (::flock(file, LOCK_EX | LOCK_NB) != 0)
    return fail(ErrorCode::kUnavailable,
                "is in use by " + holder_of(file) +
                    ": two servers would mix two histories; stop it, or name another file",
                path);
  const std::string pid = std::to_string(::getpid());
  if (::ftruncate(file, 0) != 0 || ::pwrite(file, pid.data(), pid.size(), 0) < 0) {
    // The lock holds without the number.
  }
  return claim;
}

std::optional<std::string> FileClaim::holder(const std::string& path) {
  const int file = ::open(lock_of(path).c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return std::nullopt;
  const FileClaim look(file);
  if (::flock(file, LOCK_EX | LOCK_NB) == 0) return std::nullopt;
  return holder_of(file);
}

FileClaim::~FileClaim() {
  if (file_ >= 0) ::close(file_);
}

}  // namespace fiducap
