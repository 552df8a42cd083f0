#include "base/yaml_section.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_rows.hpp"

namespace fiducap {

using namespace recording_rows;  // NOLINT: what this file is made of

namespace {

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

Expected<std::vector<TruthSample>> read_increasing(const std::filesystem::path& path) {
  return only_increasing(read<TruthSample>(path, OpenEnd::kLeaveOut, parse_truth), path);
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
  return read<RecordedTag>(layout->truth_tags_csv(), OpenEnd::kTake, parse_tag);
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
