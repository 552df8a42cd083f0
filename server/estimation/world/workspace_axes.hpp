#pragma once

#include <optional>
#include <span>

#include "estimation/body_filter.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Expresses the state in other axes: X_new = G X for every pose; errors rotate with the axes.
void move_axes(FilterState& state, const Pose& G);

/// Adds an unknown motion of the whole workspace: one world-side error of the body, all cameras,
/// clones and tags.
void add_common_error(FilterState& state, const Matrix6d& covariance);

/// Redefines W by a tag in the state: its position and heading (`level`: the vertical comes from
/// gravity), or its whole pose, become exact. No measurable quantity changes.
/// @return X_WnewWold
Pose anchor_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level);

/// Deviation of the reference tag from its exact pose (m and rad together) due to linearisation.
struct ReferenceSlack {
  double moved{};
  double sigma{};
};
[[nodiscard]] ReferenceSlack slack_of_reference(const FilterState& state, std::size_t tag,
                                                const HeadingRule& rule, bool level);

/// Redefines W by a known tag that `camera` sees at X_VT: position and heading (not `level`: the
/// whole attitude) are uncertain until the next update.
/// @return X_WnewWold
Pose anchor_to_known(FilterState& state, int camera, const Pose& X_VT, const Pose& X_WT,
                     bool level);

/// The same by a tag of the state, at its estimated pose.
Pose anchor_local_to_known(FilterState& state, std::size_t tag, const Pose& X_WT, bool level);

/// Makes the body's pose and velocity unknown, linearised at X_WB; biases, extrinsics and tags
/// stay.
void forget_motion(FilterState& state, const Pose& X_WB, bool has_imu);

/// The configured cameras and clocks, no motion, no tags.
/// @param clones  number of camera poses for tracked points
void reset(FilterState& state, const BodySensors& sensors, const EstimatorConfig& config,
           const ClockHypothesis& clocks, std::size_t clones);

/// Begins the motion at the origin. @param q_WB  nullopt: without IMU
void start(FilterState& state, Instant at, const std::optional<Eigen::Quaterniond>& q_WB);

/// Makes the time shift of a camera uncertain. No effect when clocks are not estimated.
void open_clock(FilterState& state, const BodySensors& sensors, const EstimatorConfig& config,
                int camera, double sigma_s);

[[nodiscard]] ClockEstimate clock_of(const FilterState& state, int camera);

}  // namespace fiducap::world

namespace fiducap {

/// Covariance of a body's pose due to bent paper: the tag that defines W is 0.17° (1-sigma per
/// axis) off its assumed plane, as one of 0.16 m with a bow of 0.25 mm, and W rotates about it.
/// @param p_TB_W  from the print to the body, W axes, m
/// @return covariance of (position, m; rotation vector, rad), both W axes
[[nodiscard]] inline Matrix6d bend_of_print(const Eigen::Vector3d& p_TB_W) {
  constexpr double kBend_rad = 3e-3;
  Eigen::Matrix<double, 6, 3> turn;
  turn << -skew(p_TB_W), Eigen::Matrix3d::Identity();
  return kBend_rad * kBend_rad * turn * turn.transpose();
}

/// Defines the workspace W of one filter, once: by a tag of the map, by a surveyed tag or, when the
/// map has none, by the reference tag or the first one. Afterwards that tag is estimated like any
/// other.
///
/// Functions that define W return X_new_old: earlier poses become X_new = X_new_old X_old.
class WorkspaceAnchor final {
 public:
  /// @param level  gravity defines the vertical
  WorkspaceAnchor(const WorkspaceGauge& gauge, bool level) : gauge_(gauge), level_(level) {}

  void forget() {
    is_anchored_ = false;
    defined_by_.reset();
    heading_rule_.reset();
  }
  /// The tag has left the state.
  void forget_tag(int tag_id) {
    if (defined_by_ == tag_id) defined_by_.reset();
  }
  /// From now on the map defines W.
  void give_to_map() { defined_by_.reset(); }
  [[nodiscard]] bool is_anchored() const { return is_anchored_; }
  /// The tag of the state that defines W; nullopt: the map, or a removed tag.
  [[nodiscard]] std::optional<int> defined_by() const { return defined_by_; }

  /// By a tag with a pose in W, seen at X_VT; the pose of W is uncertain until the next update.
  std::optional<Pose> by_sighting(world::FilterState& state, int camera, const Pose& X_VT,
                                  const Pose& X_WT);
  /// By tags of the state that are in the map by now: by the one with most agreeing others, if
  /// these are more than half, so that a misread id does not anchor a body.
  std::optional<Pose> by_own_tags(world::FilterState& state, std::span<const KnownTag> known);
  /// By an own tag, if allowed. Once defined: removes the slip of linearisation.
  std::optional<Pose> by_definition(world::FilterState& state, bool may_define);

 private:
  [[nodiscard]] std::optional<Pose> upright_by_floor(const world::FilterState& state,
                                                     std::size_t tag) const;
  void keep_defined(world::FilterState& state, std::size_t tag) const;

  WorkspaceGauge gauge_;
  bool level_;
  bool is_anchored_{false};
  std::optional<int> defined_by_;
  std::optional<HeadingRule> heading_rule_;
};

}  // namespace fiducap
