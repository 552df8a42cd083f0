#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/filter/growing_covariance.hpp"
#include "estimation/filter/tag_record.hpp"
#include "estimation/robocentric/state_layout.hpp"

namespace fiducap::robocentric {

/// A tag in the state: `r_T`, `q_T` of the paper.
struct LocalTag : TagRecord {
  Pose X_VT;  ///< In the axes of camera 0.
};

/// The state x of RCARS II-D3, for any number of tags and cameras, with its covariance.
///
/// Robocentric: position and velocity of the body in its own turning axes B, tags in the axes of
/// camera 0.
struct FilterState {
  Instant time{};
  Eigen::Vector3d p_WB_B{Eigen::Vector3d::Zero()};
  Eigen::Vector3d v_WB_B{Eigen::Vector3d::Zero()};
  Eigen::Quaterniond q_WB{Eigen::Quaterniond::Identity()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
  std::vector<Pose> X_BV;      ///< One per camera.
  std::vector<LocalTag> tags;  ///< Order of entry.
  GrowingCovariance covariance;

  [[nodiscard]] int cameras() const { return static_cast<int>(X_BV.size()); }
  [[nodiscard]] int size() const { return layout::tag(cameras(), static_cast<int>(tags.size())); }
  [[nodiscard]] int tag_at(std::size_t i) const {
    return layout::tag(cameras(), static_cast<int>(i));
  }
  [[nodiscard]] Pose X_WB() const { return {q_WB, q_WB * p_WB_B}; }

  /// size() × size(), symmetric.
  [[nodiscard]] auto P() { return covariance.live(); }
  [[nodiscard]] auto P() const { return covariance.live(); }

  /// Tags that are used but not corrected: none, the paper estimates all of its tags.
  [[nodiscard]] std::span<const int> held_tags() const { return {}; }
  /// Index of a tag in `tags`, or -1.
  [[nodiscard]] int find(int tag_id) const { return find_tag(tags, tag_id); }
  /// Appends a tag, uncorrelated with everything.
  void add_tag(const LocalTag& tag, const Matrix6d& own);
  /// Takes a tag out (marginalises it).
  void remove_tag(std::size_t i);
  /// Takes over everything but the covariance.
  void copy_mean(const FilterState& other);
  /// Makes room for the body and the cameras, covariance zero.
  void resize_covariance();

  /// x ⊞ δ: adds an error vector of length size() in the coordinates of state_layout.hpp.
  void add_error(const Eigen::Ref<const Eigen::VectorXd>& error);
  /// The error that leads from this state's mean to `other`'s (same tags): other = this ⊞ δ, first
  /// order in rotation.
  [[nodiscard]] Eigen::VectorXd error_to(const FilterState& other) const;
};

/// Pose, velocity and biases in workspace axes with their covariance; rate, acceleration and
/// `anchored` are left alone.
[[nodiscard]] BodyEstimate body_in_workspace(const FilterState& state);

/// Nothing to do: a tag's place is in camera or body axes, no error has a lever arm that a
/// correction changes.
inline void transport_covariance(FilterState& /*state*/,
                                 const Eigen::Ref<const Eigen::VectorXd>& /*correction*/,
                                 int /*camera*/) {}

}  // namespace fiducap::robocentric
