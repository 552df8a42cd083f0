#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "base/text.hpp"
#include "base/time.hpp"

namespace fiducap {

/// Reads a text file of fields, separated by commas, line by line, with the memory of one buffer: a
/// longer line is left out and counted as damaged. Empty lines and those that begin with `#` are
/// skipped.
class CsvReader final {
 public:
  /// @param separator  a blank: any number of blanks and tabs. A comma between digits is a decimal
  /// point where commas do not separate.
  [[nodiscard]] static Expected<CsvReader> open(const std::filesystem::path& path,
                                                char separator = ',');

  /// Moves to the next line with content. @return false at the end of the file.
  bool next();
  /// Fields of the current line without the blanks around them; valid until `next`.
  [[nodiscard]] std::span<const std::string_view> fields() const { return fields_; }
  [[nodiscard]] std::uint64_t line() const { return line_; }
  /// False when the file ended before the end of the current line: its last number may be cut.
  [[nodiscard]] bool line_is_complete() const { return complete_; }

  void count_damaged() {
    if (damaged_++ == 0) first_damaged_line_ = line_;
  }
  [[nodiscard]] std::uint64_t damaged() const { return damaged_; }
  /// One log line, if there was damage.
  void log_damage() const;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  explicit CsvReader(std::string path);
  bool fill();
  [[nodiscard]] bool take_line(std::string_view& line);

  std::string path_;
  char separator_{','};
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

/// The first `out.size()` fields. @return false when there are fewer or one is not a number.
[[nodiscard]] bool parse(std::span<const std::string_view> fields, std::span<double> out);

/// Nanoseconds since some epoch, not negative and far from the end of int64.
[[nodiscard]] bool parse_stamp(std::string_view field, std::int64_t& ns);

/// Finds the wrong stamps of a file by majority: one must not cost the lines around it.
///
/// Left out are groups of stamps more than an hour away from the largest group, and then the fewest
/// lines without which time never decreases. Needs no memory while time increases.
class StampColumn final {
 public:
  [[nodiscard]] static Expected<StampColumn> read(const std::filesystem::path& path);

  /// @pre lines are asked for in increasing order
  [[nodiscard]] bool accepts(std::uint64_t line) {
    while (next_left_out_ < left_out_.size() && left_out_[next_left_out_] < line) ++next_left_out_;
    return next_left_out_ == left_out_.size() || left_out_[next_left_out_] != line;
  }

  [[nodiscard]] std::size_t stamps() const { return stamps_; }  ///< Lines that have one.
  [[nodiscard]] std::size_t left_out() const { return left_out_.size(); }
  /// Lines without a stamp, a header among them.
  [[nodiscard]] std::size_t unreadable() const { return unreadable_; }
  /// First such field, other than a header.
  [[nodiscard]] const std::string& first_unreadable() const { return first_unreadable_; }
  /// @pre stamps() > 0
  [[nodiscard]] Instant first() const { return first_; }
  [[nodiscard]] Instant last() const { return last_; }
  /// Median step between stamps; equal ones (rows of one image) count as one.
  [[nodiscard]] Duration step() const { return step_; }
  void log_left_out() const;

 private:
  struct Stamp {
    std::int64_t ns{};
    std::uint64_t line{};
  };
  explicit StampColumn(std::string path) : path_(std::move(path)) {}
  [[nodiscard]] Expected<bool> is_in_order();
  [[nodiscard]] Expected<void> keep_majority();

  std::string path_;
  std::size_t stamps_{0};
  std::size_t unreadable_{0};
  std::string first_unreadable_;
  Instant first_{};
  Instant last_{};
  Duration step_{};
  std::vector<std::uint64_t> left_out_;  ///< Lines, increasing.
  std::size_t next_left_out_{0};
};

/// The lines of one file whose stamps can be used, see StampColumn.
class StampedRows final {
 public:
  [[nodiscard]] static Expected<StampedRows> open(const std::filesystem::path& path);
  /// Moves to the next such line; an incomplete last line is left out.
  [[nodiscard]] bool next(std::int64_t& ns);
  [[nodiscard]] std::span<const std::string_view> fields() const { return rows_.fields(); }
  void count_damaged() { rows_.count_damaged(); }
  void log_damage() const {
    rows_.log_damage();
    stamps_.log_left_out();
  }

 private:
  StampedRows(CsvReader rows, StampColumn stamps)
      : rows_(std::move(rows)), stamps_(std::move(stamps)) {}

  CsvReader rows_;
  StampColumn stamps_;
};

}  // namespace fiducap
