#pragma once

#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/expected.hpp"
#include "base/log.hpp"
#include "base/pose.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording_layout.hpp"
#include "capture/recording/stamp_column.hpp"

/// Tables of a recording that are read as a whole.
namespace fiducap::recording_rows {

// Longer than the truth of the longest recording, shorter than memory.
inline constexpr std::size_t kMost = 20'000'000;

/// px py pz qw qx qy qz. @return false when the quaternion is not one
[[nodiscard]] inline bool parse_pose(std::span<const std::string_view> fields, Pose& X) {
  std::array<double, 7> v{};
  if (!parse(fields, v)) return false;
  const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
  if (!(std::abs(q.norm() - 1) < 1e-2) || !std::isfinite(v[0] + v[1] + v[2])) return false;
  X = {q.normalized(), {v[0], v[1], v[2]}};
  return true;
}

/// Whether a last line without an end is taken: hand-written tables often have one, in a log (which
/// has stamps) it was cut.
enum class OpenEnd { kTake, kLeaveOut };

/// All rows of a file that may be absent. A first line that is no row is its header.
template <typename Row>
Expected<std::vector<Row>> read(const std::filesystem::path& path, OpenEnd open_end,
                                bool (*parse_row)(std::span<const std::string_view>, Row&)) {
  std::vector<Row> rows;
  if (!is_file(path)) return rows;
  Expected<CsvReader> reader = CsvReader::open(path);
  if (!reader) return tl::unexpected(reader.error());
  const bool is_log = open_end == OpenEnd::kLeaveOut;
  std::optional<StampColumn> stamps;
  if (is_log) {
    Expected<StampColumn> column = StampColumn::read(path);
    if (!column) return tl::unexpected(column.error());
    stamps = std::move(*column);
    stamps->log_left_out();
  }
  while (reader->next()) {
    if (is_log && !reader->line_is_complete()) break;
    if (is_log && !stamps->accepts(reader->line())) continue;
    Row row;
    if (parse_row(reader->fields(), row)) {
      if (rows.size() == kMost)
        return fail(ErrorCode::kInvalid, "has too many lines", reader->path());
      rows.push_back(row);
    } else if (reader->line() > 1) {
      reader->count_damaged();
    }
  }
  reader->log_damage();
  if (rows.empty() && reader->damaged() > 0) {
    return fail(ErrorCode::kInvalid, "no line of it can be read", reader->path());
  }
  return rows;
}

/// Who reads such rows looks for times by halves.
template <typename Row>
Expected<std::vector<Row>> only_increasing(Expected<std::vector<Row>> rows,
                                           const std::filesystem::path& path) {
  if (!rows) return rows;
  Instant last = Instant::min();
  const std::size_t backwards = std::erase_if(*rows, [&last](const Row& row) {
    if (row.at <= last) return true;
    last = row.at;
    return false;
  });
  if (backwards > 0)
    log::warning("capture", path.string() + ": " + std::to_string(backwards) +
                                " lines left out whose time does not increase");
  return rows;
}

}  // namespace fiducap::recording_rows
