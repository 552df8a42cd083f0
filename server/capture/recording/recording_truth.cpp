#include <cmath>
#include <optional>
#include <utility>

#include "base/log.hpp"
#include "base/yaml_section.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_layout.hpp"
#include "capture/recording/stamp_column.hpp"

namespace fiducap {
namespace {

// Longer than the truth of the longest recording, shorter than memory.
constexpr std::size_t kMaxRows = 20'000'000;

// px py pz qw qx qy qz. @return false when the quaternion is not one.
bool parse_pose(std::span<const std::string_view> fields, Pose& X) {
  std::array<double, 7> v{};
  if (!parse(fields, v)) return false;
  const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
  if (!(std::abs(q.norm() - 1) < 1e-2) || !std::isfinite(v[0] + v[1] + v[2])) return false;
  X = {q.normalized(), {v[0], v[1], v[2]}};
  return true;
}

bool parse_truth(std::span<const std::string_view> fields, TruthSample& truth) {
  std::int64_t ns = 0;
  if (fields.size() < 8 || !parse_stamp(fields[0], ns) ||
      !parse_pose(fields.subspan(1), truth.X_WB))
    return false;
  truth.at = instant_from_ns(ns);
  std::array<double, 9> rest{};  // poses alone are truth enough
  if (fields.size() < 17) return true;
  if (!parse(fields.subspan(8), rest)) return false;
  truth.v_WB = {rest[0], rest[1], rest[2]};
  truth.bias_w = {rest[3], rest[4], rest[5]};
  truth.bias_f = {rest[6], rest[7], rest[8]};
  return true;
}

bool parse_tag(std::span<const std::string_view> fields, RecordedTag& tag) {
  return fields.size() >= 9 && parse(fields[0], tag.tag_id) && parse(fields[1], tag.edge_m) &&
         tag.edge_m > 0 && parse_pose(fields.subspan(2), tag.X_WT);
}

/// Whether a last line without an end is taken: hand-written tables often have one, in a log (which
/// has stamps) it was cut.
enum class OpenEnd { kTake, kLeaveOut };

/// All rows of a file that may be absent. A first line that is no row is its header.
template <typename Row>
Expected<std::vector<Row>> read_rows(const std::filesystem::path& path, OpenEnd open_end,
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
      if (rows.size() == kMaxRows)
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

/// Who reads truth looks for times by halves.
Expected<std::vector<TruthSample>> read_increasing(const std::filesystem::path& path) {
  auto rows = read_rows<TruthSample>(path, OpenEnd::kLeaveOut, parse_truth);
  if (!rows) return rows;
  Instant last = Instant::min();
  const std::size_t backwards = std::erase_if(*rows, [&last](const TruthSample& row) {
    if (row.at <= last) return true;
    last = row.at;
    return false;
  });
  if (backwards > 0)
    log::warning("capture", path.string() + ": " + std::to_string(backwards) +
                                " lines left out whose time does not increase");
  return rows;
}

}  // namespace

Expected<std::vector<TruthSample>> read_truth(const std::string& folder) {
  const Expected<RecordingLayout> layout = RecordingLayout::find(folder);
  if (!layout) return tl::unexpected(layout.error());
  return read_increasing(layout->state_csv());
}

Expected<std::vector<TruthSample>> read_reference_poses(const std::string& folder) {
  const Expected<RecordingLayout> layout = RecordingLayout::find(folder);
  if (!layout) return tl::unexpected(layout.error());
  return read_increasing(layout->reference_poses_csv());
}

Expected<std::vector<RecordedTag>> read_truth_tags(const std::string& folder) {
  const Expected<RecordingLayout> layout = RecordingLayout::find(folder);
  if (!layout) return tl::unexpected(layout.error());
  return read_rows<RecordedTag>(layout->truth_tags_csv(), OpenEnd::kTake, parse_tag);
}

Expected<std::vector<Pose>> read_truth_extrinsics(const std::string& folder) {
  const Expected<RecordingLayout> layout = RecordingLayout::find(folder);
  if (!layout) return tl::unexpected(layout.error());
  std::vector<Pose> X_BV;
  if (!is_file(layout->truth_extrinsics_yaml())) return X_BV;
  const Expected<YamlSection> yaml = YamlSection::load(layout->truth_extrinsics_yaml());
  if (!yaml) return tl::unexpected(yaml.error());
  for (std::size_t k = 0; yaml->has("cam" + std::to_string(k)); ++k) {
    X_BV.push_back(yaml->section("cam" + std::to_string(k)).required_pose("T_BS"));
  }
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  return X_BV;
}

}  // namespace fiducap
