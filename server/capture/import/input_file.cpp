#include "capture/import/input_file.hpp"

#include <filesystem>

namespace fiducap {

Expected<InputFile> InputFile::open(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    return fail(ErrorCode::kNotFound, "no such file", path);
  InputFile file;
  file.path_ = path;
  file.size_ = std::filesystem::file_size(path, error);
  if (error) return fail(ErrorCode::kUnavailable, "cannot be read: " + error.message(), path);
  file.file_.open(path, std::ios::binary);
  if (!file.file_) return fail(ErrorCode::kUnavailable, "cannot be opened for reading", path);
  return file;
}

bool InputFile::read(std::uint64_t n, std::vector<std::byte>& out) {
  if (n > left()) return false;
  out.resize(static_cast<std::size_t>(n));
  if (n == 0) return true;
  if (!file_.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(n))) {
    size_ = at_;  // it has become shorter, or the disk fails: this is its end
    return false;
  }
  at_ += n;
  return true;
}

bool InputFile::skip(std::uint64_t n) { return n <= left() && seek(at_ + n); }

bool InputFile::seek(std::uint64_t at) {
  if (at > size_) return false;
  file_.clear();
  if (!file_.seekg(static_cast<std::streamoff>(at))) return false;
  at_ = at;
  return true;
}

}  // namespace fiducap
