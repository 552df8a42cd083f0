#include "capture/recording/csv_reader.hpp"

#include <algorithm>
#include <cstring>

#include "base/log.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kBufferSize = 1 << 16;
constexpr std::string_view kBlanks = " \t\r";

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

}  // namespace

Expected<CsvReader> CsvReader::open(const std::filesystem::path& path) {
  CsvReader reader(path.string());
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    return fail(ErrorCode::kNotFound, "no such file", path.string());
  }
  reader.file_.open(path, std::ios::binary);
  if (!reader.file_)
    return fail(ErrorCode::kUnavailable, "cannot be opened for reading", path.string());
  return reader;
}

CsvReader::CsvReader(std::string path) : path_(std::move(path)), buffer_(kBufferSize) {
  fields_.reserve(32);
}

// Moves the rest to the front and reads on. @return false when nothing more came.
bool CsvReader::fill() {
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  if (!file_.good()) return false;
  file_.read(buffer_.data() + end_, static_cast<std::streamsize>(buffer_.size() - end_));
  const auto got = static_cast<std::size_t>(file_.gcount());
  end_ += got;
  return got > 0;
}

bool CsvReader::take_line(std::string_view& line) {
  bool too_long = false;
  for (;;) {
    const char* from = buffer_.data() + begin_;
    const char* newline = static_cast<const char*>(std::memchr(from, '\n', end_ - begin_));
    if (newline == nullptr) {
      if (end_ - begin_ == buffer_.size()) {
        too_long = true;
        begin_ = end_;
      }
      if (fill()) continue;
      if (begin_ == end_) {
        if (too_long) count_damaged();
        return false;
      }
      newline = buffer_.data() + end_;
      from = buffer_.data();
      complete_ = false;
    }
    ++line_;
    line = std::string_view(from, static_cast<std::size_t>(newline - from));
    begin_ = std::min(end_, begin_ + line.size() + 1);
    if (!too_long) return true;
    count_damaged();
    too_long = false;
    if (!complete_) return false;
  }
}

bool CsvReader::next() {
  for (std::string_view line; take_line(line);) {
    line = trimmed(line);
    if (line.empty() || line.front() == '#') continue;
    split(line);
    return true;
  }
  fields_.clear();
  return false;
}

void CsvReader::split(std::string_view line) {
  constexpr std::size_t kMaxFields = 64;
  fields_.clear();
  while (fields_.size() < kMaxFields) {
    const std::size_t comma = line.find(',');
    fields_.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

void CsvReader::count_damaged() {
  if (damaged_++ == 0) first_damaged_line_ = line_;
}

void CsvReader::log_damage() const {
  if (damaged_ == 0) return;
  log::warning("capture", path_ + ": " + std::to_string(damaged_) +
                              " damaged lines left out, the first is line " +
                              std::to_string(first_damaged_line_));
}

bool parse(std::span<const std::string_view> fields, std::span<double> out) {
  if (fields.size() < out.size()) return false;
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!parse(fields[i], out[i])) return false;
  }
  return true;
}

bool parse_stamp(std::string_view field, std::int64_t& ns) {
  constexpr std::int64_t kLast = 4'000'000'000'000'000'000;  // the year 2096; leaves room for sums
  return parse(field, ns) && ns >= 0 && ns <= kLast;
}

}  // namespace fiducap
