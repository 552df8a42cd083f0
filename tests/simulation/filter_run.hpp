#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "estimation/body_filter.hpp"
#include "estimation/known_tag.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/body_pipeline.hpp"
#include "simulation/bound_run.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// Place, then rotation vector, in the axes in which both poses are.
[[nodiscard]] Vector6d pose_error(const Pose& estimate, const Pose& truth);

/// eᵀ P⁻¹ e
[[nodiscard]] double normalised(const Eigen::VectorXd& e, const Eigen::MatrixXd& P);

/// Whether BodyTracker would show a pose with this covariance.
[[nodiscard]] bool may_be_shown(const Matrix15d& P);

/// An image of a run, just corrected.
struct FilterMoment {
  double t_s{};  ///< Since the first sample.
  const BodyFilter& filter;
  const BodyEstimate& estimate;
  TruthSample truth;
  const Pose& X_WR;  ///< Axes of truth and true tags in the filter's workspace.
  const CornerFrame& corners;
};

/// Parameters of a run.
struct FilterChoice {
  std::string filter{"world"};
  KnowledgeCase knowledge{'A'};
  EstimatorConfig estimator{};
  /// The map is made by the bodies and returned to them, as in the server. False: it is
  /// that of the knowledge case.
  bool live{false};
  bool frozen{false};                                   ///< A live map that does not change.
  std::optional<TagMap> start{};                        ///< Initial map; nullopt: of the case.
  double refine_period_s{MapConfig{}.refine_period_s};  ///< Of a live map.
  /// Called at every image with an anchored pose.
  std::function<void(const FilterMoment&)> watch{};
  /// Called at every image with the number of its body, the update and the map.
  std::function<void(std::size_t, const BodyUpdate&, const TagMap&)> listen{};
  /// Called with each map event, after its image.
  std::function<void(const MapEvent&, Instant)> hear{};
};

/// Normalised squared errors (expected value: their degrees of freedom). NaN: not known at this
/// image.
struct Nees {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double whole{kNone};       ///< 15: pose, velocity, biases (9 without IMU).
  double pose{kNone};        ///< 6
  double velocity{kNone};    ///< 3
  double biases{kNone};      ///< 6
  double extrinsics{kNone};  ///< 6; only when they are estimated
  /// 6: mean over the tags in the state but the reference; every half second.
  double tags{kNone};
};

/// What a message names as the cause: a kind of mismatch, or an event about IMU, axes or clocks.
struct NamedCause {
  std::variant<FoundMismatch::Kind, BodyEvent::Kind> what;
  int tag_id{-1};
  bool is_ambiguous{false};  ///< As one of several.

  bool operator==(const NamedCause&) const = default;
};

/// One filter over one set of data, compared with the truth at every image.
struct FilterRun {
  struct At {
    double t_s{};  ///< Since the first sample.
    bool has_tags{};
    double position_m{};  ///< In the reference tag's axes, as the filter sees that tag.
    double rotation_rad{};
    /// In the workspace: level, origin and heading by the reference tag (or the known map).
    double level_position_m{};
    double level_rotation_rad{};
    double velocity_m_s{};  ///< Body axes.
    double rate_rad_s{};    ///< Body axes.
    double sigma_m{};       ///< Of level_position_m by the filter: root of the trace.
    bool valid{};           ///< Certain enough to be shown (BodyLimits).
    Nees nees;
    double nis{};
    int nis_dof{};
  };
  std::vector<At> at;  ///< Images with an anchored pose.
  int frames{};
  int frames_with_tags{};
  int frames_with_pose{};  ///< … and tags
  double nis{};
  long long nis_dof{};
  int tags_rejected{};
  int tags_used{};
  int tags_dropped{};
  int tags_mapped{};
  long landmarks_used{};
  double landmark_nis{};
  long long landmark_nis_dof{};
  double map_position_m{};       ///< RMSE of the tags in the state at the end, workspace.
  double near_map_position_m{};  ///< The same in the reference tag's axes, without that tag.
  /// position_m just before the reference tag is seen again after kAway_s; 0: never was.
  double gap_m{};
  double gap_path_m{};            ///< Travelled until then.
  double gap_t_s{};               ///< When it is seen again, since the first sample.
  ClockEstimate clock;            ///< At the end.
  double seconds{};               ///< Of data.
  int resets{};                   ///< The filter has forgotten everything.
  std::vector<std::string> said;  ///< Each sentence of the body's events and doubts once.
  std::vector<NamedCause> named;  ///< What these name, each once.

  [[nodiscard]] FilterRun scored_after(double t_s) const;
  /// Root of the mean square of one figure over the images.
  [[nodiscard]] double rms(const std::function<double(const At&)>& of) const;
  /// Mean over the images at which the figure is known; NaN when it never is.
  [[nodiscard]] double mean(const std::function<double(const At&)>& of) const;
  [[nodiscard]] double position_rmse_m() const {
    return rms([](const At& a) { return a.level_position_m; });
  }
  /// Of the pose, per degree of freedom.
  [[nodiscard]] double pose_nees() const {
    return mean([](const At& a) { return a.nees.pose / 6; });
  }
  [[nodiscard]] double mean_nees() const {
    return mean([](const At& a) { return a.nees.whole; });
  }
};

/// A body's pipeline over such data.
[[nodiscard]] PipelineSetup pipeline_of(const EstimationData& data, const FilterChoice& choice);
/// Room axes → the workspace that is defined by the data's reference tag.
[[nodiscard]] Pose workspace_of(const EstimationData& data);

[[nodiscard]] FilterRun run_filter(const EstimationData& data, const FilterChoice& choice);

/// Several bodies in one room over one map, in order of time (BodiesReplay).
struct TogetherRun {
  std::vector<FilterRun> bodies;
  TagMap map;               ///< At the end; W is that of the reference tag.
  double map_position_m{};  ///< RMSE of its tags.
  std::vector<MapEvent> map_events;
  double map_nees{};  ///< Mean over its tags but the reference, per degree of freedom.
};
[[nodiscard]] TogetherRun run_together(std::span<const EstimationData> data,
                                       const FilterChoice& choice);

}  // namespace fiducap
