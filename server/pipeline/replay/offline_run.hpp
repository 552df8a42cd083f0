#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/stamped_pose.hpp"
#include "capture/recording/recording.hpp"
#include "pipeline/replay/bodies_replay.hpp"

namespace fiducap {

/// Everything that decides what an offline run gives.
struct OfflineSetup : PipelineSetup {
  std::vector<KnownTag> known;  ///< Inputs of the filter: never estimated.
  /// Of a body without IMU: how it moved, for what is solved for in the end.
  std::shared_ptr<const Odometry> odometry{};
};

/// The recording's own calibration, sizes, reference tag, ignore list and known tags; configs at
/// their defaults. Known tags better than 1 mm and 1 mrad become inputs, the others priors.
[[nodiscard]] OfflineSetup offline_setup(const RecordingInfo& info);

/// What happened during a run.
struct OfflineStatistics {
  int frames{};
  int frames_with_tags{};
  int frames_with_pose{};
  int frames_with_tags_and_pose{};
  /// Their poses were in the body's own axes, or W was re-defined after them: they are left out.
  /// Resolved: none, where they belong is known.
  int frames_before_anchoring{};
  double data_s{};  ///< First to last sample.
  /// `read`: everything that is not one of the others.
  double read_cpu_s{}, detect_cpu_s{}, propagate_cpu_s{}, update_cpu_s{};
  double resolve_cpu_s{};  ///< Solving for everything after the last image.
  int imu_samples{};
  int tags_rejected{};  ///< Tag by tag, over all frames.
  int tags_used{};
  double nis_sum{};
  long long nis_dof{};
  double reprojection_median_px{};  ///< Of the frames' values after their own update.
  double reprojection_p95_px{};
  MergerStatistics merger;

  [[nodiscard]] double nis_per_dof() const {
    return nis_dof == 0 ? 0.0 : nis_sum / static_cast<double>(nis_dof);
  }
};

/// How sure the body's pose was at one image: position and rotation vector, both in W axes.
struct StampedCovariance {
  Instant at{};
  Matrix6d covariance{Matrix6d::Zero()};
};

/// One image, and in how much of it there was something to see.
struct SeenImage {
  Instant at{};
  int tags{};
};

/// What nothing ties to the workspace: a part of the way, and the tags seen there, in axes of their
/// own.
struct OfflinePart {
  std::vector<StampedPose> trajectory;
  std::vector<KnownTag> tags;
};

struct OfflineResult {
  /// One per image instant at which the filter ran and stood in the workspace. Resolved
  /// (OfflineMap::resolve): one per instant that hangs together with the workspace, by everything
  /// that was seen before and after.
  std::vector<StampedPose> trajectory;
  std::vector<StampedCovariance> covariances;  ///< Of the same instants.
  /// Resolved: what the filter gave out live. Else empty, because `trajectory` is that.
  std::vector<StampedPose> live;
  std::vector<OfflinePart> parts;  ///< Resolved, in order of time.
  std::vector<KnownTag> known;     ///< As given.
  std::vector<TagBelief> tags;     ///< As filter and map saw them at the end; resolved: as the map.
  std::vector<ExtrinsicsEstimate> extrinsics;
  std::vector<std::string> doubts;  ///< About tags that do not fit together, in words (TagDoubts).
  std::vector<BodyEvent> events;    ///< What happened to the estimate, in order.
  std::vector<SeenImage> images;    ///< All of them, in order.
  OfflineStatistics statistics;
};

/// Called now and then with the seconds of data done.
using OfflineProgress = std::function<void(double data_s)>;

/// One robot of a session that is run offline.
struct OfflineBody {
  int id{1};
  std::string name;
  OfflineSetup setup;
  SensorSource* source{};
};

/// The map that all bodies of a session share.
struct OfflineMap {
  MapConfig config{};
  TagMap start{};  ///< What is known before; the bodies' known tags are added.
  /// Of a recorded session; empty: images of all bodies by their time.
  std::vector<MapTurn> turns{};
  std::optional<std::vector<RefinementTurn>> refinements{};  ///< See BodiesReplay::follow.
  /// After the last image everything is solved for together (solve_all), and poses are those of
  /// then. A single body without IMU always is: its recording is mapping work, its map keeps
  /// improving to the last image, and poses given out early belong to a map that no longer exists.
  bool resolve{false};
  /// Tags seen so often are in the resolved map. Nullopt: all of which the branch is sure.
  std::optional<int> least_sightings{};
};

struct OfflineMapEvent {
  Instant at{};
  MapEvent event;
};

struct OfflineSession {
  std::vector<OfflineResult> bodies;
  TagMap map;
  std::vector<OfflineMapEvent> map_events;
  std::uint64_t turns_missed{};  ///< See BodiesReplay.
  LiveAgreement agreement;
  bool is_at_rest{true};  ///< Resolved: the last solution came to an end.
};

/// The start map with what a body was told to take as known: surveyed.
void add_known(const OfflineSetup& setup, TagMap& start);

/// Runs all bodies over one live map (BodiesReplay) and notes what became of each.
/// @return Error when a source is lost, or what was resolved is not finite. A source without images
/// gives an empty trajectory.
[[nodiscard]] Expected<OfflineSession> run_together(const std::vector<OfflineBody>& bodies,
                                                    const OfflineMap& map,
                                                    const OfflineProgress& progress = {});

/// The same for one body and nothing else known.
[[nodiscard]] Expected<OfflineResult> run_offline(const OfflineSetup& setup, SensorSource& source,
                                                  const OfflineProgress& progress = {});

}  // namespace fiducap
