#pragma once

#include <map>
#include <optional>
#include <vector>

#include "app/cli/tum_file.hpp"
#include "capture/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_filter.hpp"

namespace fiducap {

/// Poses of a body without IMU in the *finished* map.
///
/// A recording without IMU is mapping work: its map keeps improving to the last image, and poses given out early belong to
/// a map that no longer exists. After the run each image is placed again in the final map: from the pose it had then,
/// carried over by its nearest tag, else from the tags' own planar poses; least squares over all its corners. No filter,
/// no smoothing: one image, one pose.
class SettledTrajectory final {
 public:
  explicit SettledTrajectory(double corner_noise_px) : corner_noise_px_(corner_noise_px) {}

  /// @param X_WB   the filter's pose after this image, or nullopt while it has none
  /// @param tags   where the filter has its tags now (only those of `seen` are looked at)
  void add(const TagObservations& seen, const std::optional<Pose>& X_WB, const std::vector<KnownTag>& tags);
  /// @param map  the finished map
  [[nodiscard]] std::vector<StampedPose> settle(const std::vector<CameraMount>& cameras, const std::vector<KnownTag>& map) const;

 private:
  struct Image {
    TagObservations seen;
    std::optional<Pose> X_WB;
    std::map<int, Pose> X_WT;  ///< Of the seen tags, at that time.
  };
  [[nodiscard]] std::optional<Pose> place(const Image& image, const CameraMount& camera, const std::map<int, Pose>& map,
                                          const std::optional<StampedPose>& last) const;

  double corner_noise_px_;
  std::vector<Image> images_;
};

}  // namespace fiducap
