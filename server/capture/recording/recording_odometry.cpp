#include <cmath>

#include "base/yaml_section.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_rows.hpp"

namespace fiducap {

using namespace recording_rows;  // NOLINT: what this file is made of

namespace {

constexpr double kLeastNoise = 1e-4;
constexpr double kLargestNoise = 10;
// A phone's axes have y up; ours z.
const Eigen::Quaterniond kUpright(std::sqrt(0.5), std::sqrt(0.5), 0, 0);

bool parse_row(std::span<const std::string_view> fields, StampedPose& row) {
  std::int64_t ns = 0;
  if (fields.size() < 8 || !parse_stamp(fields[0], ns) || !parse_pose(fields.subspan(1), row.X_WB))
    return false;
  row.at = instant_from_ns(ns);
  return true;
}

/// pose_id, s since the start, x y z, qw qx qy qz.
bool parse_phone_row(std::span<const std::string_view> fields, StampedPose& row) {
  double s = 0;
  if (fields.size() < 9 || !parse(fields.subspan(1, 1), {&s, 1}) || !(s >= 0 && s < 1e9) ||
      !parse_pose(fields.subspan(2), row.X_WB))
    return false;
  row.at = Instant{} + from_seconds(s);
  return true;
}

/// Of a sensor that sits at T_BS, as the ASL layout has it.
Expected<std::optional<Odometry>> read_sensor(const RecordingLayout& layout) {
  auto rows =
      only_increasing(read<StampedPose>(layout.odometry_csv(), OpenEnd::kLeaveOut, parse_row),
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
      yaml->complain(key, "must lie between 0.0001 and 10");
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  for (const StampedPose& row : *rows) out.poses.push_back({row.at, row.X_WB * X_SB});
  return out;
}

/// Of a phone that has stamped its odometry from zero on; zero is the stamp of the first frame.
Expected<std::optional<Odometry>> read_phone(const RecordingLayout& layout) {
  const auto path = layout.phone_odometry_csv();
  auto rows = only_increasing(read<StampedPose>(path, OpenEnd::kTake, parse_phone_row), path);
  if (!rows) return tl::unexpected(rows.error());
  auto reader = CsvReader::open(layout.frames_csv(0));
  if (!reader)
    return fail(reader.error().code,
                "is needed: its first stamp is where the time of " + path.string() + " begins",
                layout.frames_csv(0).string());
  std::int64_t zero_ns = 0;
  if (!reader->next() || !parse_stamp(reader->fields().front(), zero_ns))
    return fail(ErrorCode::kInvalid, "its first line has no stamp, from which the odometry counts",
                reader->path());
  Odometry out;
  for (const StampedPose& row : *rows)
    out.poses.push_back({row.at + std::chrono::nanoseconds(zero_ns),
                         Pose{kUpright, Eigen::Vector3d::Zero()} * row.X_WB});
  return out;
}

}  // namespace

Expected<std::optional<Odometry>> read_odometry(const std::string& folder) {
  const Expected<RecordingLayout> layout = RecordingLayout::find(folder);
  if (!layout) return tl::unexpected(layout.error());
  auto out = is_file(layout->odometry_csv())         ? read_sensor(*layout)
             : is_file(layout->phone_odometry_csv()) ? read_phone(*layout)
                                                     : std::optional<Odometry>{};
  if (out && *out && (*out)->poses.size() < 2) {
    log::warning("capture", folder + ": its odometry has fewer than two poses and is not used");
    out->reset();
  }
  return out;
}

}  // namespace fiducap
