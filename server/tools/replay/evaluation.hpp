#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/recording/recording.hpp"
#include "tools/replay/run_errors.hpp"

namespace fiducap {

/// A connected part of a run.
struct RunPart {
  std::vector<StampedPose> trajectory;
  std::vector<TagPlace> map;
};

/// The results of an offline run, read back.
struct RunResults {
  std::vector<StampedPose> trajectory;
  std::vector<TagPlace> map;
  std::vector<Pose> X_BV;          ///< One per camera …
  std::vector<LensOffset> lenses;  ///< … likewise; empty: lenses are those of the recording.
  std::vector<RunPart> parts;      ///< Not connected to the workspace, in axes of their own.
};

/// @param tum  `<body>.tum`; `map.csv` and `extrinsics.yaml` are taken from beside it
[[nodiscard]] Expected<RunResults> read_run(const std::string& tum, std::size_t cameras);

/// The data behind the numbers of an evaluation, for plots.
struct EvaluationTraces {
  Instant first_image{Instant::max()};
  Instant last_image{Instant::min()};
  std::optional<Instant> settled_at;          ///< From here on poses are compared.
  std::vector<PoseDifference> differences;    ///< In the axes of the reference tag …
  Pose X_WA;                                  ///< … which the run has here.
  std::vector<double> reprojection_px;        ///< One per scored detection …
  std::vector<double> truth_reprojection_px;  ///< … and of the truth's own.
  /// Truth, or the other program's answer, in the workspace of the run.
  std::vector<StampedPose> reference_path;
  std::vector<TagPlace> reference_map;
};

/// Errors of a run. Poses are compared in the axes of the reference tag, as each side places that
/// tag; nothing is fitted, unless the reference has no tags.
struct Evaluation {
  enum class Against { kTruth, kOtherProgram, kNothing } against{Against::kNothing};
  std::optional<int> reference_tag;
  bool reference_replaced{};  ///< The recording's reference tag is missing in a map: the lowest
                              ///< common id is used.
  std::optional<PoseErrors> pose;
  std::optional<PoseErrors>
      levelled_pose;  ///< In axes at that tag with z up: its place and heading only. With IMU.
  std::optional<PoseErrors>
      world_pose;  ///< In W as both sides have it, when the recording fixes W by known tags.
  std::optional<PoseErrors>
      fitted_pose;  ///< Without a common tag: after a rigid fit over all positions.
  std::optional<PoseErrors> map;
  std::optional<PoseErrors> fitted_map;  ///< After a rigid fit over all tags: the shape alone.
  std::optional<PoseErrors> extrinsics;  ///< All cameras, against truth/extrinsics.yaml.
  ReprojectionSummary reprojection;
  /// Of the truth's own poses, tags and extrinsics, where the recording has them all.
  std::optional<ReprojectionSummary> truth_reprojection;
  int image_width_px{};  ///< Of the widest camera.
  EvaluationTraces traces;
};

/// The part before this is left out of pose errors: filters need time to estimate their biases.
inline constexpr Duration kSettling = std::chrono::seconds(5);

/// @return why the run, or the truth, cannot belong to these images; nullopt: it can
[[nodiscard]] std::optional<std::string> mismatch_of(const Evaluation& evaluation);

/// Called with the seconds of data that were processed.
using EvaluationProgress = std::function<void(double data_s)>;

/// @return Error when the recording cannot be read
[[nodiscard]] Expected<Evaluation> evaluate(const RunResults& run, const std::string& recording,
                                            const EvaluationProgress& progress = {});

}  // namespace fiducap
