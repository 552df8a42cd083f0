#include "base/whole_file.hpp"

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <system_error>

#include <fcntl.h>
#include <sys/random.h>
#include <unistd.h>

namespace fiducap {
namespace {

namespace fs = std::filesystem;

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

tl::unexpected<Error> disk_failure(const std::string& action, int error, const std::string& path) {
  return fail(
      ErrorCode::kUnavailable,
      "cannot " + action + ": " + std::strerror(error) + "; check free space and permissions",
      path);
}

/// Random, so that others with access to the folder cannot guess it.
Expected<std::string> temporary_name(const std::string& path) {
  std::uint64_t word{};
  if (::getrandom(&word, sizeof word, 0) != sizeof word)
    return disk_failure("choose a name for a temporary file", errno, path);
  return path + ".part" + std::to_string(word);
}

}  // namespace

Expected<void> write_whole_file(const std::string& path, std::string_view content, unsigned mode) {
  const fs::path target(path);
  std::error_code error;
  if (target.has_parent_path()) fs::create_directories(target.parent_path(), error);
  if (error) return disk_failure("make the folder", error.value(), target.parent_path().string());

  const auto part = temporary_name(path);
  if (!part) return tl::unexpected(part.error());
  const int number =
      ::open(part->c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode);
  if (number < 0) return disk_failure("write", errno, path);
  std::unique_ptr<std::FILE, CloseFile> file(::fdopen(number, "wb"));
  if (!file) return disk_failure("write", errno, path);
  const bool written =
      std::fwrite(content.data(), 1, content.size(), file.get()) == content.size() &&
      std::fflush(file.get()) == 0 && ::fsync(::fileno(file.get())) == 0;
  const int write_error = errno;
  file.reset();
  if (!written) {
    fs::remove(*part, error);
    return disk_failure("write", write_error, path);
  }
  fs::rename(*part, target, error);
  if (error) {
    const int rename_error = error.value();
    fs::remove(*part, error);
    return disk_failure("replace the file", rename_error, path);
  }
  return {};
}

Expected<std::string> read_whole_file(const std::string& path, std::size_t max_bytes) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return fail(ErrorCode::kNotFound, "no such file", path);
  const auto size = fs::file_size(path, error);
  if (error) return disk_failure("read", error.value(), path);
  if (size > max_bytes)
    return fail(ErrorCode::kUnsupported,
                "has " + std::to_string(size) + " bytes, at most " + std::to_string(max_bytes) +
                    " are read",
                path);
  std::ifstream file(path, std::ios::binary);
  std::string content(static_cast<std::size_t>(size), '\0');
  if (!file.read(content.data(), static_cast<std::streamsize>(content.size())))
    return disk_failure("read", errno, path);
  return content;
}

}  // namespace fiducap
