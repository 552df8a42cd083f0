#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/stamped_pose.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sample_merger.hpp"
#include "detection/detector_config.hpp"
#include "estimation/body_filter.hpp"

namespace fiducap {

/// Everything that decides what an offline run gives.
struct OfflineSetup {
  BodySensors sensors;
  TagSetConfig tags;
  DetectorConfig detector;
  EstimatorConfig estimator;
  WorkspaceGauge gauge;
  std::string filter{"world"};
  std::vector<KnownTag> known;   ///< Inputs of the filter: never estimated.
  std::vector<KnownTag> priors;  ///< Estimated, with survey knowledge.
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
  double data_s{};  ///< First to last sample.
  double read_cpu_s{}, detect_cpu_s{}, propagate_cpu_s{}, update_cpu_s{};
  double settle_cpu_s{};  ///< Without IMU: placing and refining after the last image.
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

struct OfflineResult {
  std::vector<StampedPose>
      trajectory;  ///< One per image instant at which the filter ran and stood in the workspace.
  /// Without IMU `trajectory` and `tags` are refined together (SettledTrajectory), and this is what
  /// the filter gave out live; with IMU it is empty, because `trajectory` is live.
  std::vector<StampedPose> live;
  std::vector<KnownTag> known;  ///< As given.
  std::vector<TagBelief> tags;  ///< As the filter saw them at the end; without IMU refined.
  std::vector<ExtrinsicsEstimate> extrinsics;
  std::vector<std::string> doubts;  ///< About tags that do not fit together, in words (TagDoubts).
  OfflineStatistics statistics;
};

/// Called now and then with the seconds of data done.
using OfflineProgress = std::function<void(double data_s)>;

/// Runs one body's samples through merger, detector and filter, one after the other in this thread:
/// no clock, no randomness; the same samples give the same result to the last bit.
/// @return Error when the source is lost or the refinement fails. A source without images gives an
/// empty trajectory.
[[nodiscard]] Expected<OfflineResult> run_offline(const OfflineSetup& setup, SensorSource& source,
                                                  const OfflineProgress& progress = {});

}  // namespace fiducap
