#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "capture/camera_frame.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/recording.hpp"

namespace fiducap {

/// Root mean square and worst of pose differences.
struct PoseErrors {
  int samples{};
  double position_rmse_m{};
  double position_max_m{};
  double rotation_rmse_rad{};
  double rotation_max_rad{};
};

/// `1.50 mm, 0.020° RMSE; worst 3.10 mm, 0.040°`
[[nodiscard]] std::string text_of(const PoseErrors& errors);

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

/// The truth's axes in those of the estimates by the best rigid fit of their positions (Umeyama,
/// without scale). @return nullopt with fewer than three common poses
[[nodiscard]] std::optional<Pose> fitted_axes(std::span<const StampedPose> estimates,
                                              std::span<const TruthSample> truth, Instant from);

/// One term of `pose_errors`: estimate minus truth, both vectors in axes A.
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

/// Median time from a pose to the `stride`-th next one; nullopt when there are not enough.
[[nodiscard]] std::optional<Duration> median_step(std::span<const StampedPose> poses,
                                                  std::size_t stride = 1);

/// How well poses, map and extrinsics explain the corners that were really seen, and how many
/// frames have a pose.
struct ReprojectionSummary {
  int frames{};
  int frames_with_tags{};
  int frames_with_tags_and_pose{};
  int frames_with_tags_in_parts{};  ///< Without one, but with a pose in axes of their own.
  int detections{};      ///< Usable ones; ignored ids and too many corrected bits are left out.
  int without_pose{};    ///< … whose image has no pose,
  int without_tag{};     ///< … whose tag is not in the map,
  int outside_camera{};  ///< … which pose and map put behind the camera or outside its lens model.
  int scored{};          ///< The rest.
  double median_px{};  ///< Of the root mean square distance of the four corners per detection, raw
                       ///< pixels.
  double p95_px{};
  /// Of all detections; those without a score count as worst. Nullopt: it falls on one of them.
  std::optional<double> p95_of_all_px{};
  /// Share of the frames with tags that have a pose; 1 when there is no such frame.
  [[nodiscard]] double coverage() const { return share_of(frames_with_tags_and_pose); }
  [[nodiscard]] double coverage_with_parts() const {
    return share_of(frames_with_tags_and_pose + frames_with_tags_in_parts);
  }

 private:
  [[nodiscard]] double share_of(int some) const {
    return frames_with_tags == 0 ? 1.0 : static_cast<double>(some) / frames_with_tags;
  }
};

/// Collects frame by frame. An image's pose is the one nearest to its stamp within half a frame
/// period: a run that learned the camera's clock gives poses at corrected times.
class ReprojectionMeter final {
 public:
  /// @param cameras  X_BV is what is tested
  /// @pre poses sorted by time
  ReprojectionMeter(std::vector<CameraMount> cameras, std::span<const StampedPose> poses,
                    std::span<const TagPlace> map);

  /// A part that is not connected to the workspace; used for images without a pose there.
  void add_part(std::span<const StampedPose> poses, std::span<const TagPlace> map);

  /// @param frame  usable detections only
  void add(const CornerFrame& frame);
  [[nodiscard]] ReprojectionSummary summary() const;
  /// Of every scored detection, in order.
  [[nodiscard]] const std::vector<double>& errors_px() const { return errors_px_; }

 private:
  struct Part {
    std::span<const StampedPose> poses;
    std::map<int, TagPlace> map;
  };
  void score(const TagSighting& seen, const CameraMount& camera, const Pose& X_VW,
             const std::map<int, TagPlace>& map);
  /// nullptr: the image has no pose there.
  [[nodiscard]] const StampedPose* pose_near(std::span<const StampedPose> poses, Instant at) const;

  std::vector<CameraMount> cameras_;
  std::vector<Part> parts_;  ///< First: in the workspace.
  /// Half the time between two images of one camera; the cameras take turns.
  Duration half_period_{0};
  ReprojectionSummary counts_;
  std::vector<double> errors_px_;
};

}  // namespace fiducap
