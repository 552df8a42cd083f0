#include "estimation/filter/heading_rule.hpp"

#include <cmath>

#include "base/so3.hpp"

namespace fiducap {

namespace {

// A tag axis steeper than this gives no heading.
constexpr double kSteep = 0.9;

Eigen::Quaterniond yaw(double angle) { return exp_so3({0, 0, angle}); }

}  // namespace

HeadingRule make_heading_rule(const WorkspaceGauge& gauge, const Eigen::Quaterniond& q_WT) {
  HeadingRule rule;
  const Eigen::Matrix3d R = gauge.X_WT ? gauge.X_WT->rotation() : q_WT.toRotationMatrix();
  while (rule.axis < 1 && std::abs(R(2, rule.axis)) > kSteep) ++rule.axis;
  if (gauge.X_WT) {
    rule.X_WT = *gauge.X_WT;
    rule.yaw_rad = std::atan2(R(1, rule.axis), R(0, rule.axis));
  }
  return rule;
}

Eigen::Quaterniond turn_to_heading(const HeadingRule& rule, const Eigen::Quaterniond& q_WT) {
  const Eigen::Vector3d h = q_WT * Eigen::Vector3d::Unit(rule.axis);
  return yaw(rule.yaw_rad - std::atan2(h.y(), h.x()));
}

Eigen::Quaterniond turn_closest(const Eigen::Quaterniond& wanted_q_WT,
                                const Eigen::Quaterniond& q_WT) {
  const Eigen::Matrix3d M = (wanted_q_WT * q_WT.conjugate()).toRotationMatrix();
  return yaw(std::atan2(M(1, 0) - M(0, 1), M(0, 0) + M(1, 1)));
}

Pose axes_between(const Pose& from, const Pose& to, bool level) {
  const Eigen::Quaterniond turn =
      level ? turn_closest(to.q, from.q) : (to.q * from.q.conjugate()).normalized();
  return {turn, to.p - turn * from.p};
}

}  // namespace fiducap
