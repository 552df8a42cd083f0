#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "base/quantile.hpp"
#include "capture/camera_frame.hpp"
#include "capture/lens/camera_model.hpp"
#include "tools/replay/pose_errors.hpp"

namespace fiducap {

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
  /// Of all detections, with those that are not scored as worse than any. Nullopt: there are so
  /// many of them that it is one of them.
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

  /// What is not tied to the rest; counts where there is no pose there.
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
  Duration half_period_{0};  ///< Of the poses; half the median step.
  ReprojectionSummary counts_;
  std::vector<double> errors_px_;
};

}  // namespace fiducap
