#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/lens/lens_offset.hpp"
#include "capture/recording/recording.hpp"
#include "tools/replay/pose_errors.hpp"
#include "tools/replay/reprojection.hpp"

namespace fiducap {

/// Poses and tags that hang together.
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
  std::vector<RunPart> parts;      ///< What nothing ties to the workspace, in axes of their own.
};

/// @param tum  `<body>.tum`; `map.csv` and `extrinsics.yaml` are taken from beside it
[[nodiscard]] Expected<RunResults> read_run(const std::string& tum, std::size_t cameras);

/// What the numbers of an evaluation were made of, for pictures.
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

/// How good a run is. Poses are compared in the axes of the reference tag, as each side places that
/// tag; nothing is fitted.
struct Evaluation {
  enum class Against { kTruth, kOtherProgram, kNothing } against{Against::kNothing};
  std::optional<int> reference_tag;
  bool reference_replaced{};  ///< The recording's reference tag is missing in a map: the lowest
                              ///< common id stands in.
  std::optional<PoseErrors> pose;
  std::optional<PoseErrors>
      levelled_pose;  ///< In axes at that tag with z up: its place and heading only. With IMU.
  std::optional<PoseErrors>
      world_pose;  ///< In W as both sides have it, when the recording fixes W by known tags.
  std::optional<PoseErrors> map;
  std::optional<PoseErrors> fitted_map;  ///< After a rigid fit over all tags: the shape alone.
  std::optional<PoseErrors> extrinsics;  ///< All cameras, against truth/extrinsics.yaml.
  ReprojectionSummary reprojection;
  /// Of the truth's own poses, tags and extrinsics, where the recording has them all.
  std::optional<ReprojectionSummary> truth_reprojection;
  int image_width_px{};  ///< Of the widest camera.
  EvaluationTraces traces;
};

/// The part before this is left out of pose errors: a filter may need a moment to find its biases.
inline constexpr Duration kSettling = std::chrono::seconds(5);

/// @return why the numbers mean nothing: the run, or the truth, is not of these images; nullopt:
/// they do
[[nodiscard]] std::optional<std::string> mismatch_of(const Evaluation& evaluation);

/// Called now and then with the seconds of data that were looked at.
using EvaluationProgress = std::function<void(double data_s)>;

/// @return Error when the recording cannot be read
[[nodiscard]] Expected<Evaluation> evaluate(const RunResults& run, const std::string& recording,
                                            const EvaluationProgress& progress = {});

}  // namespace fiducap
