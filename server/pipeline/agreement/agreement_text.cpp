#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "base/so3.hpp"
#include "pipeline/agreement/rotation_agreement.hpp"

namespace fiducap {

namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
// So near an axis of the camera, a turn is about this axis.
constexpr double kAlong = 0.9;
// A mirrored gyro whose axes are this far from three right angles is described by no words.
constexpr double kNearAxis = 0.85;
constexpr std::string_view kWithheld = "poses are withheld. ";

std::string axis_text(const Eigen::Vector3d& axis_V) {
  Eigen::Index along = 0;
  if (axis_V.cwiseAbs().maxCoeff(&along) < kAlong)
    return fmt::format("the axis ({:.2f}, {:.2f}, {:.2f}) of its own", axis_V.x(), axis_V.y(),
                       axis_V.z());
  if (along == 2) return "its optical axis";
  return along == 0 ? "its horizontal axis (x)" : "its vertical axis (y)";
}

std::string turned_text(int camera, const CameraMount& mount, const AgreementFinding& finding) {
  const Eigen::Matrix3d R_BV = mount.X_BV.rotation();
  const Eigen::Quaterniond turn_V(Eigen::Matrix3d(R_BV.transpose() * finding.A * R_BV));
  const Eigen::Quaterniond right(Eigen::Matrix3d(finding.A * R_BV));
  const Eigen::Vector3d turn = log_so3(turn_V.normalized());
  return fmt::format(
      "camera {} looks along other axes than the configuration says: turned by {:.0f}° about {}, "
      "as the gyro has it; {}Correct bodies[].cameras[].X_BV (the turns fit with q_wxyz: [{:.2f}, "
      "{:.2f}, {:.2f}, {:.2f}], good to {:.0f}°; `fiducap calibrate extrinsics` refines it), or "
      "the axes of the IMU if all cameras say so",
      camera, turn.norm() * kDegrees, axis_text(turn.normalized()), kWithheld, right.w(), right.x(),
      right.y(), right.z(), std::ceil(3 * finding.axes_sigma_rad * kDegrees));
}

/// `(y, x, z)`: what a gyro gives where (x, y, z) is meant; empty: no such words fit.
std::string axes_given(const Eigen::Matrix3d& A) {
  std::string all;
  for (Eigen::Index row = 0; row < 3; ++row) {
    Eigen::Index axis = 0;
    if (A.row(row).cwiseAbs().maxCoeff(&axis) < kNearAxis) return {};
    all += fmt::format("{}{}{}", row == 0 ? "" : ", ", A(row, axis) < 0 ? "-" : "",
                       std::string_view("xyz").substr(static_cast<std::size_t>(axis), 1));
  }
  return "(" + all + ")";
}

std::string reflected_text(int camera, const AgreementFinding& finding) {
  const std::string given = axes_given(finding.A);
  return fmt::format(
      "two gyro axes are swapped or one sign is wrong: no turn of camera {} explains what it sees, "
      "a mirrored gyro does{}; {}Correct the axes that the IMU's driver gives (right-handed, and "
      "the same for gyro and accelerometer)",
      camera, given.empty() ? "" : " (it seems to give " + given + " where (x, y, z) is meant)",
      kWithheld);
}

std::string shift_text(int camera, const CameraMount& mount, const AgreementFinding& finding) {
  const double told_s = to_seconds(mount.time_shift);
  return fmt::format(
      "images of camera {} are stamped {:.2f} s {} against the IMU ({:.2f} ± {:.2f} s where {:.2f} "
      "± {:.2f} s is told); {}Correct bodies[].cameras[].time_shift_s (the turns fit with {:.2f}), "
      "or look at how images and IMU get their stamps",
      camera, std::abs(finding.shift_s), finding.shift_s < 0 ? "late" : "early",
      told_s + finding.shift_s, finding.shift_sigma_s, told_s, mount.time_shift_sigma_s, kWithheld,
      told_s + finding.shift_s);
}

}  // namespace

std::string agreement_text(int camera, const CameraMount& mount, const AgreementFinding& finding) {
  using Kind = AgreementFinding::Kind;
  switch (finding.kind) {
    case Kind::kAgree:
      return fmt::format("camera {} and the gyro agree again", camera);
    case Kind::kAxesTurned:
      return turned_text(camera, mount, finding);
    case Kind::kAxesReflected:
      return reflected_text(camera, finding);
    case Kind::kAxesApart:
      return fmt::format(
          "camera {} and the gyro do not turn about the same axes: the camera is turned against "
          "bodies[].cameras[].X_BV, or axes of the gyro are swapped or have wrong signs; {}Turn "
          "the body about all three axes and it is said which",
          camera, kWithheld);
    case Kind::kShifted:
      return shift_text(camera, mount, finding);
    case Kind::kJumped:
      return fmt::format(
          "the clock of camera {} has jumped by {:.2f} s against the IMU (stamps are now {:.2f} s "
          "{} than before); the estimate follows, poses are withheld until it has. Look at what "
          "sets the clocks of camera and IMU",
          camera, std::abs(finding.jump_s), std::abs(finding.jump_s),
          finding.jump_s < 0 ? "later" : "earlier");
  }
  return {};
}

}  // namespace fiducap
