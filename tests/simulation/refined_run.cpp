#include "simulation/refined_run.hpp"

#include <cmath>

#include "base/expected.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "support/memory_source.hpp"

namespace fiducap {

namespace {

FilterRun::At compare(const EstimationData& data, const Pose& X_WR, const Pose& X_WT,
                      const StampedPose& pose, const Matrix6d& covariance) {
  const Pose X_WB = X_WR * data.truth_near(pose.at).X_WB;
  const Pose X_WT_true = X_WR * data.tag(data.reference_tag)->X_WT;
  const Vector6d level = pose_error(pose.X_WB, X_WB);
  const Vector6d near = pose_error(X_WT.inverse() * pose.X_WB, X_WT_true.inverse() * X_WB);
  FilterRun::At at;
  at.t_s = to_seconds(pose.at - time_of(data.samples.front()));
  at.position_m = near.head<3>().norm();
  at.rotation_rad = near.tail<3>().norm();
  at.level_position_m = level.head<3>().norm();
  at.level_rotation_rad = level.tail<3>().norm();
  at.sigma_m = std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  at.nees.pose = normalised(level, covariance);
  return at;
}

}  // namespace

RefinedRun run_refined(const EstimationData& data, const FilterChoice& choice) {
  FIDUCAP_ASSERT(data.imu.has_value() && choice.knowledge.letter == 'A');
  FilterChoice live = choice;
  live.live = true;
  MemorySource source(data.samples);
  const OfflineSetup setup{pipeline_of(data, live), {}};
  OfflineMap map;
  map.resolve = true;
  map.config.refine_period_s = kRefinePeriod_s;
  const auto session = run_together({{1, data.name, setup, &source}}, map);
  FIDUCAP_ASSERT(session.has_value());
  const Pose X_WR = workspace_of(data);
  const MapTag* reference = session->map.find(data.reference_tag);
  const Pose X_WT =
      reference != nullptr ? reference->tag.X_WT : X_WR * data.tag(data.reference_tag)->X_WT;
  const OfflineResult& result = session->bodies.front();
  RefinedRun out;
  out.is_at_rest = session->is_at_rest;
  out.poses.frames = result.statistics.frames;
  for (std::size_t i = 0; i < result.trajectory.size(); ++i)
    out.poses.at.push_back(
        compare(data, X_WR, X_WT, result.trajectory[i], result.covariances[i].covariance));
  std::vector<KnownTag> tags;
  for (const MapTag& entry : session->map.tags)
    if (entry.component == 0) tags.push_back(entry.tag);
  out.map = map_errors(tags, data, X_WR, X_WT);
  return out;
}

}  // namespace fiducap
