#pragma once

#include <charconv>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

/// Reads a comma-separated text file line by line. Memory stays at one buffer, whatever the file
/// holds: a line longer than the buffer is counted as damaged and left out. Empty lines and lines
/// that begin with `#` are skipped.
class CsvReader final {
 public:
  [[nodiscard]] static Expected<CsvReader> open(const std::filesystem::path& path);

  /// Moves to the next line with content. @return false at the end of the file.
  bool next();
  /// Fields of the current line without the blanks around them; valid until `next`.
  [[nodiscard]] std::span<const std::string_view> fields() const { return fields_; }
  [[nodiscard]] std::uint64_t line() const { return line_; }
  /// False when the file ended before the end of the current line: its last number may be cut.
  [[nodiscard]] bool line_is_complete() const { return complete_; }

  /// The caller cannot use the current line.
  void count_damaged();
  [[nodiscard]] std::uint64_t damaged() const { return damaged_; }
  /// One log line when there was damage; nothing otherwise.
  void log_damage() const;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  explicit CsvReader(std::string path);
  bool fill();
  [[nodiscard]] bool take_line(std::string_view& line);
  void split(std::string_view line);

  std::string path_;
  std::ifstream file_;
  std::vector<char> buffer_;
  std::size_t begin_{0};
  std::size_t end_{0};
  std::vector<std::string_view> fields_;
  std::uint64_t line_{0};
  std::uint64_t damaged_{0};
  std::uint64_t first_damaged_line_{0};
  bool complete_{true};
};

/// The whole field as a number, nothing left over.
template <typename Number>
[[nodiscard]] bool parse(std::string_view field, Number& out) {
  const char* end = field.data() + field.size();
  const auto [stop, error] = std::from_chars(field.data(), end, out);
  return error == std::errc() && stop == end;
}

/// As many fields as there are numbers wanted. @return false when there are fewer or one is not a
/// number.
[[nodiscard]] bool parse(std::span<const std::string_view> fields, std::span<double> out);

/// Nanoseconds since some epoch, not negative and far from the end of int64.
[[nodiscard]] bool parse_stamp(std::string_view field, std::int64_t& ns);

}  // namespace fiducap
