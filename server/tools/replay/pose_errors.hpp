#pragma once

#include <optional>
#include <span>
#include <vector>

#include "capture/recording/recording.hpp"
#include "tools/replay/tum_file.hpp"

namespace fiducap {

/// Root mean square and worst of pose differences.
struct PoseErrors {
  int samples{};
  double position_rmse_m{};
  double position_max_m{};
  double rotation_rmse_rad{};
  double rotation_max_rad{};
};

/// Adds up pose differences.
class ErrorSum final {
 public:
  /// Both in the same axes.
  void add(const Pose& estimated, const Pose& truth);
  [[nodiscard]] PoseErrors result() const;

 private:
  PoseErrors errors_;
  double position_squares_{0};
  double rotation_squares_{0};
};

/// The true pose at `at`: the sample of that instant, or between the two around it (position
/// linear, attitude slerp).
/// @param truth  sorted by time
/// @return nullopt outside of the truth and where its samples are more than 50 ms apart.
[[nodiscard]] std::optional<Pose> truth_at(std::span<const TruthSample> truth, Instant at);

/// Errors of the body's pose in axes A that are given both in the estimate's and in the truth's
/// workspace; nothing is fitted.
/// @param from  estimates before this instant are left out
[[nodiscard]] PoseErrors pose_errors(std::span<const StampedPose> estimates,
                                     std::span<const TruthSample> truth, const Pose& estimated_X_WA,
                                     const Pose& true_X_WA, Instant from);

/// What `pose_errors` adds up: estimate less truth, both vectors in axes A.
struct PoseDifference {
  Instant at{};
  Eigen::Vector3d p{Eigen::Vector3d::Zero()};
  Eigen::Vector3d rotation{Eigen::Vector3d::Zero()};  ///< Rotation vector from truth to estimate.
};

/// @return one per estimate that has a truth, by time; parameters as those of pose_errors
[[nodiscard]] std::vector<PoseDifference> pose_differences(std::span<const StampedPose> estimates,
                                                           std::span<const TruthSample> truth,
                                                           const Pose& estimated_X_WA,
                                                           const Pose& true_X_WA, Instant from);

/// A tag's pose in the map.
struct TagPlace {
  int tag_id{};
  double edge_m{};
  Pose X_WT;
};

/// Errors of the tags that both maps have, in the axes of the reference tag (which is not counted
/// itself).
[[nodiscard]] PoseErrors map_errors(std::span<const TagPlace> estimated,
                                    std::span<const TagPlace> truth, int reference_tag);

/// The same after the best rigid fit over the tags' corners (Umeyama, without scale): agreement in
/// shape.
/// @return nullopt with fewer than two common tags.
[[nodiscard]] std::optional<PoseErrors> fitted_map_errors(std::span<const TagPlace> estimated,
                                                          std::span<const TagPlace> truth);

/// Axes at the tag's place with z up and the tag's heading: that of its x axis, or of its y axis
/// when x is upright.
/// @param along_x  which one; must be the same for estimate and truth
[[nodiscard]] Pose levelled(const Pose& X_WT, bool along_x);
/// @return true when the x axis is closer to horizontal than y.
[[nodiscard]] bool heading_along_x(const Pose& X_WT);

[[nodiscard]] const TagPlace* find_tag(std::span<const TagPlace> tags, int tag_id);

}  // namespace fiducap
