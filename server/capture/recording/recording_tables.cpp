// Tables of a recording that are read as a whole: odometry and truth.
#include <algorithm>
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
#include "base/yaml_section.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/odometry.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

// More than the longest recording has, and less than memory.
constexpr std::size_t kMostRows = 20'000'000;

/// px py pz qw qx qy qz. @return false when the quaternion is not one
bool parse_pose(std::span<const std::string_view> fields, Pose& X) {
  std::array<double, 7> v{};
  if (!parse(fields, v)) return false;
  const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
  if (!(std::abs(q.norm() - 1) < 1e-2) || !std::isfinite(v[0] + v[1] + v[2])) return false;
  X = {q.normalized(), {v[0], v[1], v[2]}};
  return true;
}

/// A last line without end: usual in hand-written tables, incomplete in a log (with stamps).
enum class OpenEnd { kTake, kLeaveOut };

/// All rows of a file; none if it is absent. A first line that is no row is its header.
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
      if (rows.size() == kMostRows)
        return fail(ErrorCode::kInvalid, "has too many lines", reader->path());
      rows.push_back(row);
    } else if (reader->line() > 1) {
      reader->count_damaged();
    }
  }
  reader->log_damage();
  if (rows.empty() && reader->damaged() > 0)
    return fail(ErrorCode::kInvalid, "no line of it is readable", reader->path());
  return rows;
}

/// Rows are searched by bisection.
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

// Poses further apart are not interpolated.
constexpr Duration kLongestGap = std::chrono::seconds(2);

auto not_before(const std::vector<StampedPose>& poses, Instant at) {
  return std::lower_bound(poses.begin(), poses.end(), at,
                          [](const StampedPose& pose, Instant t) { return pose.at < t; });
}

constexpr double kLeastNoise = 1e-4;
constexpr double kLargestNoise = 10;
// The axes of a phone have y up, ours z.
const Eigen::Quaterniond kUpright(std::sqrt(0.5), std::sqrt(0.5), 0, 0);

bool parse_stamped(std::span<const std::string_view> fields, Instant& at, Pose& X) {
  std::int64_t ns = 0;
  if (fields.size() < 8 || !parse_stamp(fields[0], ns) || !parse_pose(fields.subspan(1), X))
    return false;
  at = instant_from_ns(ns);
  return true;
}

bool parse_odometry(std::span<const std::string_view> fields, StampedPose& row) {
  return parse_stamped(fields, row.at, row.X_WB);
}

/// pose_id, s since the start, x y z, qw qx qy qz.
bool parse_phone(std::span<const std::string_view> fields, StampedPose& row) {
  double s = 0;
  if (fields.size() < 9 || !parse(fields.subspan(1, 1), {&s, 1}) || !(s >= 0 && s < 1e9) ||
      !parse_pose(fields.subspan(2), row.X_WB))
    return false;
  row.at = Instant{} + from_seconds(s);
  return true;
}

/// Of a sensor at T_BS, as in the ASL layout.
Expected<std::optional<Odometry>> read_sensor(const RecordingLayout& layout) {
  auto rows = only_increasing(
      read_rows<StampedPose>(layout.odometry_csv(), OpenEnd::kLeaveOut, parse_odometry),
      layout.odometry_csv());
  if (!rows) return tl::unexpected(rows.error());
  const auto yaml = YamlSection::load(layout.odometry_yaml());
  if (!yaml) return tl::unexpected(yaml.error());
  Odometry out;
  const Pose X_SB = yaml->pose("T_BS").value_or(Pose{}).inverse();
  out.move_noise_m = yaml->number("move_noise_m").value_or(out.move_noise_m);
  out.turn_noise_rad = yaml->number("turn_noise_rad").value_or(out.turn_noise_rad);
  for (const auto& [key, value] :
       {std::pair("move_noise_m", out.move_noise_m), {"turn_noise_rad", out.turn_noise_rad}})
    if (!(value >= kLeastNoise && value < kLargestNoise))
      yaml->add_fault(key, "must lie between 0.0001 and 10");
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  for (const StampedPose& row : *rows) out.poses.push_back({row.at, row.X_WB * X_SB});
  return out;
}

/// Of a phone, whose time zero is the stamp of the first frame.
Expected<std::optional<Odometry>> read_phone(const RecordingLayout& layout) {
  const auto path = layout.phone_odometry_csv();
  auto rows = only_increasing(read_rows<StampedPose>(path, OpenEnd::kTake, parse_phone), path);
  if (!rows) return tl::unexpected(rows.error());
  auto reader = CsvReader::open(layout.frames_csv(0));
  if (!reader)
    return fail(reader.error().code,
                "is needed: its first stamp is the time zero of " + path.string(),
                layout.frames_csv(0).string());
  std::int64_t zero_ns = 0;
  if (!reader->next() || !parse_stamp(reader->fields().front(), zero_ns))
    return fail(ErrorCode::kInvalid, "its first line has no stamp, the time zero of the odometry",
                reader->path());
  Odometry out;
  for (const StampedPose& row : *rows)
    out.poses.push_back({row.at + std::chrono::nanoseconds(zero_ns),
                         Pose{kUpright, Eigen::Vector3d::Zero()} * row.X_WB});
  return out;
}

bool parse_truth(std::span<const std::string_view> fields, TruthSample& truth) {
  if (!parse_stamped(fields, truth.at, truth.X_WB)) return false;
  std::array<double, 9> rest{};  // optional
  if (fields.size() < 17) return true;
  if (!parse(fields.subspan(8), rest)) return false;
  truth.v_WB = {rest[0], rest[1], rest[2]};
  truth.bias_w = {rest[3], rest[4], rest[5]};
  truth.bias_f = {rest[6], rest[7], rest[8]};
  return true;
}

bool parse_tag(std::span<const std::string_view> fields, RecordedTag& tag) {
  return fields.size() >= 9 && parse_number(fields[0], tag.tag_id) &&
         parse_number(fields[1], tag.edge_m) && tag.edge_m > 0 &&
         parse_pose(fields.subspan(2), tag.X_WT);
}

Expected<std::vector<TruthSample>> read_increasing(const std::filesystem::path& path) {
  return only_increasing(read_rows<TruthSample>(path, OpenEnd::kLeaveOut, parse_truth), path);
}

}  // namespace

bool Odometry::covers(Instant at) const {
  if (poses.empty() || at < poses.front().at || poses.back().at < at) return false;
  const auto after = not_before(poses, at);
  return after->at == at || after->at - std::prev(after)->at <= kLongestGap;
}

Pose Odometry::pose_at(Instant at) const {
  const auto after = not_before(poses, at);
  if (after == poses.begin() || after->at == at) return after->X_WB;
  const StampedPose& a = *std::prev(after);
  const StampedPose& b = *after;
  const double share = to_seconds(at - a.at) / to_seconds(b.at - a.at);
  return {a.X_WB.q.slerp(share, b.X_WB.q), a.X_WB.p + share * (b.X_WB.p - a.X_WB.p)};
}

std::optional<Pose> Odometry::motion(Instant from, Instant to) const {
  if (!covers(from) || !covers(to)) return std::nullopt;
  return pose_at(from).inverse() * pose_at(to);
}

Expected<std::optional<Odometry>> read_odometry(const RecordingLayout& layout) {
  auto out = is_file(layout.odometry_csv())         ? read_sensor(layout)
             : is_file(layout.phone_odometry_csv()) ? read_phone(layout)
                                                    : std::optional<Odometry>{};
  if (out && *out && (*out)->poses.size() < 2) {
    log::warning("capture", layout.folder().string() +
                                ": its odometry has fewer than two poses and is not used");
    out->reset();
  }
  return out;
}

Expected<std::vector<TruthSample>> read_truth(const RecordingLayout& layout) {
  for (const auto& sensor : {layout.state(), layout.motion_capture(), layout.markers()}) {
    if (!is_file(sensor / "data.csv")) continue;
    auto truth = read_increasing(sensor / "data.csv");
    if (!truth || !is_file(sensor / "sensor.yaml")) return truth;
    const Expected<YamlSection> yaml = YamlSection::load(sensor / "sensor.yaml");
    if (!yaml) return tl::unexpected(yaml.error());
    const Pose X_SB = yaml->pose("T_BS").value_or(Pose{}).inverse();
    for (TruthSample& sample : *truth) sample.X_WB = sample.X_WB * X_SB;
    return yaml->check().map([&] { return std::move(*truth); });
  }
  return std::vector<TruthSample>{};
}

Expected<std::vector<TruthSample>> read_truth(const std::string& folder) {
  return RecordingLayout::find(folder).and_then(
      [](const RecordingLayout& layout) { return read_truth(layout); });
}

Expected<std::vector<TruthSample>> read_reference_poses(const std::string& folder) {
  return RecordingLayout::find(folder).and_then(
      [](const RecordingLayout& layout) { return read_increasing(layout.reference_poses_csv()); });
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
  for (std::size_t k = 0; yaml->has("cam" + std::to_string(k)); ++k)
    X_BV.push_back(yaml->section("cam" + std::to_string(k)).required_pose("T_BS"));
  return yaml->check().map([&] { return std::move(X_BV); });
}

}  // namespace fiducap
