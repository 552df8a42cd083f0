#include "tools/replay/evaluation.hpp"

#include <algorithm>
#include <filesystem>

#include "base/text.hpp"
#include "base/whole_file.hpp"
#include "daemon/system.hpp"
#include "detection/tag_detector.hpp"
#include "tools/replay/run_files.hpp"
#include "tools/tags/map_files.hpp"

namespace fiducap {
namespace {

/// Truth, or another program's answer, in the recording.
struct Reference {
  Evaluation::Against against{Evaluation::Against::kNothing};
  std::vector<TruthSample> poses;
  std::vector<TagPlace> map;
  std::vector<Pose> X_BV;
};

Expected<Reference> read_reference(const std::string& recording) {
  Reference reference;
  auto truth = read_truth(recording);
  auto other = read_reference_poses(recording);
  const auto tags = read_truth_tags(recording);
  auto extrinsics = read_truth_extrinsics(recording);
  if (!truth) return tl::unexpected(truth.error());
  if (!other) return tl::unexpected(other.error());
  if (!tags) return tl::unexpected(tags.error());
  if (!extrinsics) return tl::unexpected(extrinsics.error());
  if (!truth->empty())
    reference.against = Evaluation::Against::kTruth;
  else if (!other->empty() || !tags->empty())
    reference.against = Evaluation::Against::kOtherProgram;
  reference.poses = truth->empty() ? std::move(*other) : std::move(*truth);
  for (const RecordedTag& tag : *tags) reference.map.push_back({tag.tag_id, tag.edge_m, tag.X_WT});
  reference.X_BV = std::move(*extrinsics);
  return reference;
}

/// The recording's reference tag when both maps have it, else the lowest common id.
void choose_reference_tag(const RecordingInfo& info, const RunResults& run,
                          const Reference& reference, Evaluation& evaluation) {
  const auto common = [&](int id) {
    return find_tag(run.map, id) != nullptr && find_tag(reference.map, id) != nullptr;
  };
  if (info.reference_tag && common(*info.reference_tag)) {
    evaluation.reference_tag = info.reference_tag;
    return;
  }
  for (const TagPlace& tag : run.map) {
    if (!common(tag.tag_id)) continue;
    if (!evaluation.reference_tag || tag.tag_id < *evaluation.reference_tag)
      evaluation.reference_tag = tag.tag_id;
  }
  evaluation.reference_replaced =
      info.reference_tag.has_value() && evaluation.reference_tag.has_value();
}

std::optional<PoseErrors> extrinsics_errors(const std::vector<Pose>& estimated,
                                            const std::vector<Pose>& truth) {
  if (truth.empty() || truth.size() != estimated.size()) return std::nullopt;
  ErrorSum sum;
  for (std::size_t k = 0; k < truth.size(); ++k) sum.add(estimated[k], truth[k]);
  return sum.result();
}

std::vector<StampedPose> poses_of(const Reference& reference) {
  std::vector<StampedPose> poses;
  for (const TruthSample& sample : reference.poses) poses.push_back({sample.at, sample.X_WB});
  return poses;
}

/// The reference in the workspace of the run, aligned at the reference tag.
void trace_reference(const Reference& reference, const Pose& ours, const Pose& theirs,
                     EvaluationTraces& traces) {
  const Pose X_ours_theirs = ours * theirs.inverse();
  traces.X_WA = ours;
  traces.reference_path = poses_of(reference);
  for (StampedPose& pose : traces.reference_path) pose.X_WB = X_ours_theirs * pose.X_WB;
  traces.reference_map = reference.map;
  for (TagPlace& tag : traces.reference_map) tag.X_WT = X_ours_theirs * tag.X_WT;
}

void compare(const RecordingInfo& info, const RunResults& run, const Reference& reference,
             Evaluation& evaluation) {
  evaluation.against = reference.against;
  evaluation.extrinsics = extrinsics_errors(run.X_BV, reference.X_BV);
  evaluation.fitted_map = fitted_map_errors(run.map, reference.map);
  choose_reference_tag(info, run, reference, evaluation);
  if (!evaluation.reference_tag) {
    if (reference.poses.empty()) return;
    const Instant from = reference.poses.front().at + kSettling;
    if (const auto axes = fitted_axes(run.trajectory, reference.poses, from))
      evaluation.fitted_pose = pose_errors(run.trajectory, reference.poses, *axes, Pose{}, from);
    return;
  }
  const Pose& ours = find_tag(run.map, *evaluation.reference_tag)->X_WT;
  const Pose& theirs = find_tag(reference.map, *evaluation.reference_tag)->X_WT;
  evaluation.map = map_errors(run.map, reference.map, *evaluation.reference_tag);
  trace_reference(reference, ours, theirs, evaluation.traces);
  if (reference.poses.empty()) return;
  const Instant from = reference.poses.front().at + kSettling;
  evaluation.pose = pose_errors(run.trajectory, reference.poses, ours, theirs, from);
  evaluation.traces.settled_at = from;
  evaluation.traces.differences =
      pose_differences(run.trajectory, reference.poses, ours, theirs, from);
  if (info.imu) {
    const bool along_x = heading_along_x(theirs);
    evaluation.levelled_pose = pose_errors(run.trajectory, reference.poses, levelled(ours, along_x),
                                           levelled(theirs, along_x), from);
  }
  if (!info.known_tags.empty())
    evaluation.world_pose = pose_errors(run.trajectory, reference.poses, Pose{}, Pose{}, from);
}

/// Frames of a recording with their usable detections.
class UsableCorners final {
 public:
  explicit UsableCorners(const RecordingInfo& info) : tags_(tags_of(info)) {}

  CornerFrame of(SensorSample sample) {
    if (const auto* image = std::get_if<CameraFrame>(&sample)) {
      if (!detector_) detector_.emplace(tags_, DetectorConfig{});
      return filtered(detector_->detect(*image));
    }
    return filtered(std::move(std::get<CornerFrame>(sample)));
  }

 private:
  CornerFrame filtered(CornerFrame frame) const {
    std::erase_if(frame.tags, [&](const TagSighting& tag) {
      return tag.hamming > tags_.max_hamming ||
             std::find(tags_.ignore.begin(), tags_.ignore.end(), tag.tag_id) != tags_.ignore.end();
    });
    return frame;
  }

  TagSetConfig tags_;
  std::optional<TagDetector> detector_;
};

/// Run and truth against the corners that were seen.
Expected<void> reproject(RecordingInfo info, const RunResults& run, const Reference& reference,
                         Evaluation& evaluation, const EvaluationProgress& progress) {
  info.imu.reset();
  const SystemClock clock;
  const auto source = open_recording(info, {}, clock);
  if (!source) return tl::unexpected(source.error());
  std::vector<CameraMount> cameras = info.cameras;
  std::vector<CameraMount> true_cameras = info.cameras;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    cameras[k].X_BV = run.X_BV[k];
    if (k < run.lenses.size()) cameras[k].model = run.lenses[k].applied_to(cameras[k].model);
    if (k < reference.X_BV.size()) true_cameras[k].X_BV = reference.X_BV[k];
    evaluation.image_width_px = std::max(evaluation.image_width_px, cameras[k].model.width);
  }
  ReprojectionMeter meter(std::move(cameras), run.trajectory, run.map);
  for (const RunPart& part : run.parts) meter.add_part(part.trajectory, part.map);
  const std::vector<StampedPose> true_poses = poses_of(reference);
  ReprojectionMeter truth(std::move(true_cameras), true_poses, reference.map);
  UsableCorners corners(info);
  EvaluationTraces& traces = evaluation.traces;
  for (;;) {
    auto sample = (*source)->next({});
    if (!sample) return tl::unexpected(sample.error());
    if (!*sample) break;
    if (std::holds_alternative<ImuSample>(**sample)) continue;
    const CornerFrame frame = corners.of(std::move(**sample));
    meter.add(frame);
    truth.add(frame);
    traces.first_image = std::min(traces.first_image, frame.exposed_at);
    traces.last_image = std::max(traces.last_image, frame.exposed_at);
    if (progress) progress(to_seconds(frame.exposed_at - traces.first_image));
  }
  traces.reprojection_px = meter.errors_px();
  traces.truth_reprojection_px = truth.errors_px();
  evaluation.reprojection = meter.summary();
  if (truth.summary().scored > 0) evaluation.truth_reprojection = truth.summary();
  return {};
}

Expected<std::vector<StampedPose>> read_tum(const std::string& path) {
  return read_whole_file(path).and_then(
      [&](const std::string& text) { return tum_from(text, path); });
}

Expected<std::vector<RunPart>> read_parts(const std::filesystem::path& folder,
                                          const std::string& body) {
  std::vector<RunPart> parts;
  for (;;) {
    const std::string path = (folder / part_name(body, parts.size())).string();
    std::error_code ignored;
    if (!std::filesystem::exists(path + ".tum", ignored)) return parts;
    auto trajectory = read_tum(path + ".tum");
    if (!trajectory) return tl::unexpected(trajectory.error());
    const auto map = read_map_file(path + ".csv");
    if (!map) return tl::unexpected(map.error());
    parts.push_back({std::move(*trajectory), places_in(*map)});
  }
}

}  // namespace

Expected<RunResults> read_run(const std::string& tum, std::size_t cameras) {
  if (auto same = check_same_run(tum); !same) return tl::unexpected(same.error());
  const std::filesystem::path folder = std::filesystem::path(tum).parent_path();
  const std::string body = std::filesystem::path(tum).stem().string();
  auto trajectory = read_tum(tum);
  if (!trajectory) return tl::unexpected(trajectory.error());
  const auto map = read_map_file((folder / "map.csv").string());
  if (!map) return tl::unexpected(map.error());
  const std::string own = (folder / (body + ".extrinsics.yaml")).string();
  const std::string beside =
      std::filesystem::exists(own) ? own : (folder / "extrinsics.yaml").string();
  const auto extrinsics = read_whole_file(beside).and_then(
      [&](const std::string& text) { return extrinsics_from_yaml(text, cameras, beside); });
  if (!extrinsics) return tl::unexpected(extrinsics.error());
  auto parts = read_parts(folder, body);
  if (!parts) return tl::unexpected(parts.error());
  RunResults run{std::move(*trajectory), {}, {}, {}, std::move(*parts)};
  for (const RunCamera& camera : *extrinsics) {
    run.X_BV.push_back(camera.X_BV);
    run.lenses.push_back(camera.lens);
  }
  run.map = places_in(*map);
  return run;
}

Expected<Evaluation> evaluate(const RunResults& run, const std::string& recording,
                              const EvaluationProgress& progress) {
  const auto info = read_recording_info(recording);
  if (!info) return tl::unexpected(info.error());
  const auto reference = read_reference(recording);
  if (!reference) return tl::unexpected(reference.error());
  Evaluation evaluation;
  compare(*info, run, *reference, evaluation);
  if (auto done = reproject(*info, run, *reference, evaluation, progress); !done)
    return tl::unexpected(done.error());
  return evaluation;
}

std::optional<std::string> mismatch_of(const Evaluation& evaluation) {
  // Even a poor calibration is ten times better.
  constexpr double kNotTheseImages = 0.05;
  const double limit_px = kNotTheseImages * evaluation.image_width_px;
  const auto off = [](double px) { return "the tags are seen " + fixed(px, 0) + " px (median) "; };
  const auto& truth = evaluation.truth_reprojection;
  if (truth && truth->median_px > limit_px)
    return off(truth->median_px) +
           "from where the truth has them: the truth is that of another recording, or of another "
           "clock";
  if (evaluation.reprojection.scored > 0 && evaluation.reprojection.median_px > limit_px)
    return off(evaluation.reprojection.median_px) +
           "from where the run has them: it is the run of another recording, or it has failed";
  return std::nullopt;
}

}  // namespace fiducap
