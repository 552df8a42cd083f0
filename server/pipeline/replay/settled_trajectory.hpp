#pragma once

#include <map>
#include <optional>
#include <vector>

#include "base/expected.hpp"
#include "base/stamped_pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/start/resection.hpp"

namespace fiducap {

/// What is known when the last image has been seen.
struct SettlingStart {
  std::vector<CameraMount> cameras;
  std::vector<KnownTag> known;      ///< Never moved.
  std::vector<KnownTag> estimated;  ///< Where the filter left them.
  std::vector<KnownTag> priors;     ///< Survey knowledge of estimated tags.
  std::optional<int> gauge_tag;     ///< Held when there is neither a known tag nor a prior.
};

struct Settlement {
  std::vector<StampedPose> trajectory;  ///< One per instant with a tag of the map.
  std::vector<KnownTag> tags;           ///< `estimated`, refined.
  int images{};                         ///< With tags, at the instants of `trajectory`.
};

/// Map and poses of a body without IMU, after the last image.
///
/// A recording without IMU is mapping work: its map keeps improving to the last image, and poses
/// given out early belong to a map that no longer exists. After the run every instant is placed in
/// the final map: each tag proposes where the body stands (the filter's pose then, carried over by
/// its nearest tag; both planar poses of the nearest tags), least squares over all corners of all
/// cameras improves each proposal, the cheapest counts. Then map and poses are refined together
/// (mapping/refinement), and again while the better map takes instants out of a wrong planar
/// branch. No smoothing: the instants around one only choose between its branches.
class SettledTrajectory final {
 public:
  explicit SettledTrajectory(double corner_noise_px) : corner_noise_px_(corner_noise_px) {}

  /// @param X_WB   the filter's pose after this image, or nullopt while it has none
  /// @param tags   where the filter has its tags now (only those of `seen` are looked at)
  void add(const TagObservations& seen, const std::optional<Pose>& X_WB,
           const std::vector<KnownTag>& tags);
  /// All images of a camera were taken by another lens than was thought when they were added.
  void see_through(int camera, const CameraModel& lens);
  /// @return empty when no image saw a tag of the map; Error when the refinement fails
  [[nodiscard]] Expected<Settlement> settle(const SettlingStart& start);

 private:
  using TagPoses = std::map<int, Pose>;
  struct Proposal {
    int tag_id{};
    Pose X_TB;
  };
  struct Frame {
    Instant at{};
    std::vector<TagObservations> images;  ///< Of all cameras at this instant.
    std::vector<Proposal> proposals;      ///< The filter's first, then by size of the tag.
    std::optional<Pose> X_WB;             ///< Settled.
  };
  void propose_planar_poses(Frame& frame, const std::vector<CameraMount>& cameras) const;
  /// @return true when a frame has another pose than before
  bool place_all(const std::vector<CameraMount>& cameras, const TagPoses& map);
  [[nodiscard]] std::optional<Pose> place(const Frame& frame,
                                          const std::vector<CameraMount>& cameras,
                                          const TagPoses& map,
                                          const std::vector<StampedPose>& neighbours) const;
  [[nodiscard]] static std::vector<SightedTag> sightings(const Frame& frame,
                                                         const std::vector<CameraMount>& cameras,
                                                         const TagPoses& map);
  /// Moves `tags`, and the frames with them.
  Expected<void> refine_all(const SettlingStart& start, std::vector<KnownTag>& tags);

  double corner_noise_px_;
  std::vector<Frame> frames_;
};

}  // namespace fiducap
