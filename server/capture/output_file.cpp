#include "capture/output_file.hpp"

#include <cerrno>
#include <charconv>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace fiducap {
namespace {

constexpr std::size_t kBuffer_bytes = 65536;  // about one system call per second, not per line

Error disk_error(const std::filesystem::path& path, int error) {
  return {ErrorCode::kUnavailable,
          "cannot be written: " + std::generic_category().message(error) +
              "; check free space and permissions",
          path.string()};
}

}  // namespace

Expected<OutputFile> OutputFile::create(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path.parent_path(), error);
  if (error) return tl::unexpected(disk_error(path.parent_path(), error.value()));
  int descriptor = -1;
  do {
    descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  } while (descriptor < 0 && errno == EINTR);
  if (descriptor < 0) return tl::unexpected(disk_error(path, errno));
  return OutputFile(path, descriptor);
}

OutputFile::~OutputFile() { static_cast<void>(close()); }

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      buffer_(std::move(other.buffer_)),
      bytes_(other.bytes_),
      failure_(std::move(other.failure_)) {}

OutputFile& OutputFile::operator=(OutputFile&& other) noexcept {
  if (this == &other) return *this;
  static_cast<void>(close());
  path_ = std::move(other.path_);
  descriptor_ = std::exchange(other.descriptor_, -1);
  buffer_ = std::move(other.buffer_);
  bytes_ = other.bytes_;
  failure_ = std::move(other.failure_);
  return *this;
}

Expected<void> OutputFile::write(std::string_view bytes) {
  if (failure_) return tl::unexpected(*failure_);
  buffer_ += bytes;
  return buffer_.size() < kBuffer_bytes ? Expected<void>{} : flush();
}

Expected<void> OutputFile::flush() {
  if (failure_) return tl::unexpected(*failure_);
  std::string_view left = buffer_;
  while (!left.empty()) {
    const ::ssize_t taken = ::write(descriptor_, left.data(), left.size());
    if (taken < 0 && errno == EINTR) continue;
    if (taken < 0) return refused(errno);
    bytes_ += static_cast<std::uint64_t>(taken);
    left.remove_prefix(static_cast<std::size_t>(taken));
  }
  buffer_.clear();
  return {};
}

Expected<void> OutputFile::close() {
  if (descriptor_ < 0)
    return failure_ ? Expected<void>(tl::unexpected(*failure_)) : Expected<void>{};
  const auto flushed = flush();
  // Not again after EINTR: the descriptor is closed then, and may have been reused.
  const bool closed = ::close(std::exchange(descriptor_, -1)) == 0 || errno == EINTR;
  if (flushed && !closed) return refused(errno);
  return flushed;
}

tl::unexpected<Error> OutputFile::refused(int error) {
  failure_ = disk_error(path_, error);
  return tl::unexpected(*failure_);
}

Expected<std::uint64_t> write_output_file(const std::filesystem::path& path,
                                          std::string_view content) {
  auto file = OutputFile::create(path);
  if (!file) return tl::unexpected(file.error());
  if (const auto done = file->write(content); !done) return tl::unexpected(done.error());
  if (const auto done = file->close(); !done) return tl::unexpected(done.error());
  return file->bytes();
}

Expected<CsvWriter> CsvWriter::create(const std::filesystem::path& path, std::string_view header) {
  auto file = OutputFile::create(path);
  if (!file) return tl::unexpected(file.error());
  CsvWriter writer(std::move(*file));
  if (const auto done = writer.text(header).end_line(); !done) return tl::unexpected(done.error());
  return writer.flush().map([&] { return std::move(writer); });
}

CsvWriter& CsvWriter::integer(std::int64_t value) {
  separate();
  char digits[24];
  line_.append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
  return *this;
}

CsvWriter& CsvWriter::number(double value, int decimals) {
  separate();
  char digits[400];  // the largest double has 309 digits before the point
  const char* end =
      std::to_chars(digits, digits + sizeof(digits), value, std::chars_format::fixed, decimals).ptr;
  std::string_view text(digits, static_cast<std::size_t>(end - digits));
  if (text.find('.') != std::string_view::npos) {
    text = text.substr(0, text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.remove_suffix(1);
  }
  line_ += text;
  return *this;
}

CsvWriter& CsvWriter::exact(double value) {
  separate();
  char digits[32];
  line_.append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
  return *this;
}

CsvWriter& CsvWriter::exact(const Eigen::Vector3d& v) {
  return exact(v.x()).exact(v.y()).exact(v.z());
}

}  // namespace fiducap
