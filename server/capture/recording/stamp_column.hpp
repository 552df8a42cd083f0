#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"

namespace fiducap {

/// The stamps of one file of a recording, judged by majority before its lines are used: one wrong
/// stamp may not cost the lines around it.
///
/// Left out are groups of stamps that lie more than an hour from the largest group, and then the
/// fewest lines without which time never goes back. Reading needs no memory while time goes
/// forward.
class StampColumn final {
 public:
  [[nodiscard]] static Expected<StampColumn> read(const std::filesystem::path& path);

  /// @pre lines are asked for in increasing order
  [[nodiscard]] bool accepts(std::uint64_t line);

  [[nodiscard]] std::size_t stamps() const { return stamps_; }  ///< Lines that have one.
  [[nodiscard]] std::size_t left_out() const { return left_out_.size(); }
  /// Lines without a stamp, a header among them.
  [[nodiscard]] std::size_t unreadable() const { return unreadable_; }
  /// What the first line, other than a header, has in its place.
  [[nodiscard]] const std::string& first_unreadable() const { return first_unreadable_; }
  /// @pre stamps() > 0
  [[nodiscard]] Instant first() const { return first_; }
  [[nodiscard]] Instant last() const { return last_; }
  /// Median time from one stamp to the next, equal ones (rows of one image) taken as one.
  [[nodiscard]] Duration step() const { return step_; }
  /// One log line when stamps were left out; nothing otherwise.
  void log_left_out() const;

 private:
  struct Stamp {
    std::int64_t ns{};
    std::uint64_t line{};
  };
  explicit StampColumn(std::string path) : path_(std::move(path)) {}
  [[nodiscard]] Expected<bool> is_in_order();
  [[nodiscard]] Expected<std::vector<Stamp>> read_all() const;
  void keep_majority(const std::vector<Stamp>& all);

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

}  // namespace fiducap
