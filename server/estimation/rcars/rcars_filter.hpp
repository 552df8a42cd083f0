#pragma once

#include <map>
#include <optional>
#include <vector>

#include "estimation/body_filter.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/rcars/equations.hpp"
#include "estimation/rcars/state.hpp"
#include "estimation/start/tag_candidates.hpp"

namespace fiducap::rcars {

/// The filter of RCARS II-D: M. Neunert, M. Bloesch, J. Buchli, "An Open Source, Fiducial Based,
/// Visual-Inertial Motion Capture System", FUSION 2016.
///
/// Wrong tags are rejected by the Mahalanobis gate alone; when nothing fits for long, the filter
/// forgets everything and restarts. Clocks, lenses and noise are as configured. Different from the
/// authors' code, which failed in measurements: exact rotations and mid-point forces, no random
/// walk on tags and extrinsics, joint gate and update of all tags of an image, the branch of a
/// tag's planar pose selected over several views.
class RcarsFilter final : public BodyFilter {
 public:
  /// @pre the body has an IMU
  RcarsFilter(BodySensors sensors, WorkspaceGauge gauge, const EstimatorConfig& config);

  void propagate(const ImuSample& imu) override;
  UpdateReport update(const TagObservations& seen, const MapKnowledge& map) override;
  void set_tag_priors(std::vector<KnownTag> priors) override;
  /// No effect: the pose without tags has a growing covariance.
  void lose_motion() override {}
  [[nodiscard]] bool running() const override { return is_anchored_ || !x_.tags.empty(); }
  [[nodiscard]] BodyEstimate estimate() const override;
  void tag_beliefs(std::vector<TagBelief>& out) const override;
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override;
  /// Not estimated.
  [[nodiscard]] ClockEstimate clock(int) const override { return {}; }

 private:
  void restart();
  void start(Instant at);
  void predict(Instant to);
  void correct(const View& view, const std::vector<Sighting>& tags, Instant at,
               UpdateReport& report);
  /// Tags join once the branch of their pose is certain.
  void join(const TagObservations& seen, const View& view, const std::vector<Sighting>& tags,
            bool is_alone, const MapKnowledge& map, UpdateReport& report);
  void join_state(const TagObservation& seen, const View& view, const Pose& X_VT, Instant at,
                  bool may_define);
  void define_workspace(const MapKnowledge& map);
  void moved_workspace(const Pose& X_new_old);

  BodySensors sensors_;
  WorkspaceGauge gauge_;
  EstimatorConfig config_;
  Eigen::Vector3d g_W_;
  double gate_;
  std::map<int, KnownTag> priors_;

  State x_;
  ImuBuffer imu_;
  AttitudeStart attitude_;
  TagCandidates candidates_;
  bool is_started_{false};
  bool is_anchored_{false};
  std::optional<int> defined_by_;    ///< The tag of the state that defines W …
  HeadingRule heading_rule_;         ///< … in this way.
  std::optional<Pose> gauge_shift_;  ///< Of the present image.
  Instant last_fit_{};
  int generation_{0};
};

}  // namespace fiducap::rcars
