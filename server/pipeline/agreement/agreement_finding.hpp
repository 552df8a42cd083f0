#pragma once

#include <optional>
#include <span>

#include "pipeline/agreement/turn_fit.hpp"

namespace fiducap {

/// What was found about one camera and the gyro.
struct AgreementFinding {
  enum class Kind {
    kAgree,          ///< Axes and clock are as expected.
    kAxesTurned,     ///< The camera (or the gyro) is turned against its configured axes.
    kAxesReflected,  ///< Two axes of the gyro are swapped, or a sign is wrong.
    kAxesApart,      ///< One of both: the body turns about too few axes to tell.
    kShifted,        ///< The camera's stamps are further off than is told.
    kJumped,         ///< They were right, and are not any more.
  } kind{Kind::kAgree};
  /// gyro = A · camera, body axes.
  Eigen::Matrix3d A{Eigen::Matrix3d::Identity()};
  double axes_sigma_rad{};  ///< About the axis that is known worst.
  double shift_s{};         ///< t_imu = stamp + shift, beyond what is configured.
  double shift_sigma_s{};
  double jump_s{};  ///< Of kJumped: how much `shift_s` has changed.

  /// By which A turns. @pre it reflects nothing
  [[nodiscard]] double angle_rad() const;
};

/// What is known of a camera's clock before its turns are looked at.
struct ExpectedShift {
  double shift_s{};
  double tolerance_s{};
  bool was_measured{false};     ///< Not only told: what differs now has changed.
  bool axes_were_wrong{false};  ///< Agreement has to exclude what was found before.
};

/// The simplest single cause that explains what camera and gyro say of the same turns: as expected;
/// another shift; other axes; both. nullopt: they show too little, or nothing explains them.
/// @param pairs  oldest first
[[nodiscard]] std::optional<AgreementFinding> find_cause(std::span<const TurnPair> pairs,
                                                         const ExpectedShift& expected);

}  // namespace fiducap
