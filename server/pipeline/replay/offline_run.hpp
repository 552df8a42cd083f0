#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "capture/recording/recording.hpp"
#include "detection/no_tag.hpp"
#include "pipeline/replay/batch_solution.hpp"

namespace fiducap {

/// All parameters of one body of an offline run.
struct OfflineSetup : PipelineSetup {
  std::vector<KnownTag> known;                 ///< Inputs of the filter: never estimated.
  std::shared_ptr<const Odometry> odometry{};  ///< Without IMU: for the batch solution.
};

/// With the recorded sigmas as covariance.
[[nodiscard]] KnownTag known_tag(const RecordedTag& tag);

/// The recording's own calibration, sizes, reference tag, ignore list and known tags; configs at
/// their defaults. Known tags better than 1 mm and 1 mrad become inputs, the others priors.
[[nodiscard]] OfflineSetup offline_setup(const RecordingInfo& info);

struct OfflineStatistics {
  int frames{};
  int frames_with_tags{};
  int frames_with_pose{};
  int frames_with_tags_and_pose{};
  /// Left out: poses in the body's own axes, or before W was redefined. Resolved: 0.
  int frames_before_anchoring{};
  double data_s{};  ///< First to last sample.
  /// `read`: everything except the others.
  double read_cpu_s{}, detect_cpu_s{}, propagate_cpu_s{}, update_cpu_s{};
  double resolve_cpu_s{};  ///< Batch solution after the last image.
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

/// Of the body's pose at one image: position and rotation vector, both in W axes.
struct StampedCovariance {
  Instant at{};
  Matrix6d covariance{Matrix6d::Zero()};
};

/// One image and its number of tags.
struct SeenImage {
  Instant at{};
  int tags{};
};

/// A part of the trajectory that is not connected with the workspace, with its tags, in axes of its
/// own.
struct OfflinePart {
  std::vector<StampedPose> trajectory;
  std::vector<KnownTag> tags;
};

struct OfflineResult {
  /// One per image instant with the filter anchored. Resolved (OfflineMap::resolve): one per
  /// instant connected with the workspace, by all images before and after.
  std::vector<StampedPose> trajectory;
  std::vector<StampedCovariance> covariances;  ///< Of the same instants.
  std::vector<StampedPose> live;               ///< Resolved: the filter's trajectory; else empty.
  std::vector<OfflinePart> parts;              ///< Resolved, in order of time.
  std::vector<KnownTag> known;                 ///< As given.
  std::vector<TagBelief> tags;                 ///< Final, of filter and map; resolved: of the map.
  std::vector<ExtrinsicsEstimate> extrinsics;
  std::vector<std::string> doubts;  ///< Messages about tags (TagDoubts).
  std::vector<BodyEvent> events;    ///< In order.
  std::vector<SeenImage> images;    ///< All of them, in order.
  std::set<int> seen;               ///< Ids of all tags.
  FewImages few;                    ///< Of the source, for why_no_tag.
  OfflineStatistics statistics;
};

/// Progress of a run, after each image and in the batch solution.
struct OfflineProgress {
  double data_s{};  ///< Of the image's body.
  Instant at{};     ///< Of the image, with OfflineBody::later.
  int round{};      ///< Of the last solution; 0: still reading.
  std::size_t tags{};
};
using OfflineWatch = std::function<void(const OfflineProgress&)>;

/// One robot of an offline session.
struct OfflineBody {
  int id{1};
  std::string name;
  OfflineSetup setup;
  SensorSource* source{};
  Duration later{0};  ///< Added to its stamps for the order of the images.
};

/// The map that all bodies of a session share.
struct OfflineMap {
  MapConfig config{};
  TagMap start{};  ///< The bodies' known tags are added.
  /// Of a recorded session; empty: images of all bodies by their time.
  std::vector<MapTurn> turns{};
  std::optional<std::vector<RefinementTurn>> refinements{};  ///< See BodiesReplay::follow.
  /// Final poses by a batch solution after the last image (solve_all). Always so for a single body
  /// without IMU: its map improves until the last image, and early poses belong to another map.
  bool resolve{false};
  /// The batch solution is for the map alone: OfflineSession::graph instead of final poses.
  bool keeps_graph{false};
  /// Least sightings of tags in the resolved map. Nullopt: all tags whose branch is sure.
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
  BatchResult solved{.last = {.is_at_rest = true}};  ///< Of the batch solution.
  std::vector<GraphFinding> findings;
  std::optional<GraphState> graph;
  double run_cpu_s{};
  double resolve_cpu_s{};
};

/// Adds a body's known tags to the start map, as surveyed.
void add_known(const OfflineSetup& setup, TagMap& start);

/// Runs all bodies over one live map (BodiesReplay).
/// @return Error when a source is lost, or the batch solution is not finite. A source without
/// images gives an empty trajectory.
[[nodiscard]] Expected<OfflineSession> run_together(const std::vector<OfflineBody>& bodies,
                                                    const OfflineMap& map,
                                                    const OfflineWatch& watch = {});

/// The same for one body and an empty map.
[[nodiscard]] Expected<OfflineResult> run_offline(const OfflineSetup& setup, SensorSource& source);

}  // namespace fiducap
