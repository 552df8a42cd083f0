#include "pipeline/rotation_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "base/numeric.hpp"
#include "base/pose.hpp"

namespace fiducap {
namespace {

using Kind = AgreementFinding::Kind;

// Turns for a first decision, between two decisions, and for the clock alone: only the newest ones
// show a jump. Ten turns are a second.
constexpr std::size_t kFewestTurns = 10;
constexpr std::size_t kTurnsPerDecision = 3;
constexpr std::size_t kTurnsOfClock = 12;
// Decisions in a row with the same result: for a finding, and for the end of a contradiction or a
// cause that stays unclear.
constexpr int kSure = 2;
constexpr int kVerySure = 6;
// Ratio of squares up to which the configuration explains the turns, and nothing else is tried.
constexpr double kFits = 1.7;
// s: 1-sigma of the clock of a running filter, where its configured one is smaller: drift, jitter.
constexpr double kFilterClock_s = 0.012;
// Deviations in sigmas that a filter corrects by itself: smaller ones are no finding.
constexpr double kByFilter_sigma = 5;
constexpr double kShift_sigma = 3;
// s: nearer to the end of the offsets that are tried the minimum may lie beyond.
constexpr double kNearEnd_s = 2 * TimeOffset::kStep_s;
// Sigmas below which clock and axes are known: half of what a filter corrects by itself.
constexpr double kKnownShift_s = 0.035;
constexpr double kKnownAxes_rad = 0.14;

bool are_the_same(const AgreementFinding& a, const AgreementFinding& b) {
  constexpr double kSameShift_s = 0.05;
  constexpr double kSameAxes = 0.5;  // matrix norm, 20°
  return a.kind == b.kind && std::abs(a.fit.shift_s - b.fit.shift_s) < kSameShift_s &&
         (a.kind == Kind::kAxesApart || (a.fit.A - b.fit.A).norm() < kSameAxes);
}

// Cosine to an axis of the camera, above which this axis is named.
constexpr double kAlong = 0.9;
// The same for the axes of a mirrored gyro.
constexpr double kNearAxis = 0.85;
constexpr std::string_view kWithheld = "poses are withheld. ";

std::string axis_text(const Eigen::Vector3d& axis_V) {
  Eigen::Index along = 0;
  if (axis_V.cwiseAbs().maxCoeff(&along) < kAlong)
    return fmt::format("its axis ({:.2f}, {:.2f}, {:.2f})", axis_V.x(), axis_V.y(), axis_V.z());
  if (along == 2) return "its optical axis";
  return along == 0 ? "its horizontal axis (x)" : "its vertical axis (y)";
}

std::string turned_text(int camera, const CameraMount& mount, const AgreementFinding& finding) {
  const Eigen::Matrix3d R_BV = mount.X_BV.rotation();
  const Eigen::Quaterniond turn_V(Eigen::Matrix3d(R_BV.transpose() * finding.fit.A * R_BV));
  const Eigen::Quaterniond right(Eigen::Matrix3d(finding.fit.A * R_BV));
  const Eigen::Vector3d turn = log_so3(turn_V.normalized());
  return fmt::format(
      "camera {} looks along other axes than configured: turned by {:.0f}° about {}, by the gyro; "
      "{}Correct bodies[].cameras[].X_BV (the rotations fit with q_wxyz: [{:.2f}, {:.2f}, {:.2f}, "
      "{:.2f}], good to {:.0f}°; `fiducap calibrate extrinsics` refines it), or the axes of the "
      "IMU if all cameras are turned",
      camera, turn.norm() * kDegreesPerRadian, axis_text(turn.normalized()), kWithheld, right.w(),
      right.x(), right.y(), right.z(),
      std::ceil(3 * finding.fit.axes_sigma_rad * kDegreesPerRadian));
}

/// `(y, x, z)`: what a gyro gives where (x, y, z) is meant; empty: it cannot be described so.
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
  const std::string given = axes_given(finding.fit.A);
  return fmt::format(
      "two gyro axes are swapped or one sign is wrong: the images of camera {} fit no rotated gyro "
      "but a mirrored one{}; {}Correct the axes of the IMU's driver (right-handed, and the same "
      "for "
      "gyro and accelerometer)",
      camera, given.empty() ? "" : " (it seems to give " + given + " where (x, y, z) is meant)",
      kWithheld);
}

std::string shift_text(int camera, const CameraMount& mount, const AgreementFinding& finding) {
  const double configured_s = to_seconds(mount.time_shift);
  return fmt::format(
      "images of camera {} are stamped {:.2f} s {} against the IMU ({:.2f} ± {:.2f} s, configured "
      "{:.2f} ± {:.2f} s); {}Correct bodies[].cameras[].time_shift_s (the rotations fit with "
      "{:.2f}), or check how images and IMU are stamped",
      camera, std::abs(finding.fit.shift_s), finding.fit.shift_s < 0 ? "late" : "early",
      configured_s + finding.fit.shift_s, finding.fit.shift_sigma_s, configured_s,
      mount.time_shift_sigma_s, kWithheld, configured_s + finding.fit.shift_s);
}

/// Sums of such times do not overflow.
bool is_sane(Instant stamp) {
  constexpr std::int64_t kMost_ns = std::int64_t{1} << 62;
  return to_ns(stamp) > -kMost_ns && to_ns(stamp) < kMost_ns;
}

}  // namespace

CameraAgreement::CameraAgreement(const CameraMount& mount, double start_shift_s,
                                 double corner_noise_px)
    : mount_(mount),
      offset_(mount.model, mount.X_BV.q, corner_noise_px),
      start_shift_s_(start_shift_s),
      used_shift_s_(start_shift_s) {}

void CameraAgreement::add(const TagObservations& seen, const GyroIntegral& gyro, bool fits) {
  const bool is_settled = is_established() && !reported_shift_s_ && !has_degrees_;
  if (is_settled && fits) {
    offset_.keep(seen);
    new_turns_ = 0;
    candidate_.reset();
    return;
  }
  new_turns_ += offset_.add(seen, gyro);
  if (offset_.turns() < kFewestTurns || new_turns_ < kTurnsPerDecision) return;
  new_turns_ = 0;
  judge();
}

void CameraAgreement::judge() {
  std::optional<AgreementFinding> found = find_cause();
  const bool again = found && candidate_ && are_the_same(*found, *candidate_);
  found_again_ = again ? found_again_ + 1 : 1;
  candidate_ = std::move(found);
  if (!candidate_ || found_again_ < kSure) return;
  if (candidate_->kind == Kind::kDegrees) {
    has_degrees_ = true;
  } else if (candidate_->kind == Kind::kAgree) {
    note_agreement(*candidate_);
  } else if (candidate_->kind != Kind::kShifted && candidate_->kind != Kind::kJumped) {
    note_wrong_axes(*candidate_);
  } else if (!reported_shift_s_ ||
             std::abs(candidate_->fit.shift_s - *reported_shift_s_) > tolerance_s()) {
    new_finding_ = candidate_;
    new_finding_->jump_s = candidate_->fit.shift_s - used_shift_s_;
    reported_shift_s_ = candidate_->fit.shift_s;
    is_clock_known_ = true;
    if (candidate_->kind == Kind::kJumped) forget_turns();
  }
}

double CameraAgreement::tolerance_s() const {
  return kByFilter_sigma * std::max(mount_.time_shift_sigma_s, kFilterClock_s);
}

/// The simplest single cause that explains the turns: as expected, another clock, other axes.
/// @return nullopt: too little motion, or no cause explains it
std::optional<AgreementFinding> CameraAgreement::find_cause() const {
  const ClockPrior prior{used_shift_s_, std::max(mount_.time_shift_sigma_s, kFilterClock_s)};
  const std::size_t newest = is_clock_known_ ? kTurnsOfClock : TimeOffset::kTurns;
  const OffsetFit expected = offset_.fit(Axes::kConfigured, prior, newest);
  if (is_as_expected(expected) && expected.misfit < kFits && !axes_are_wrong_)
    return AgreementFinding{Kind::kAgree, expected};
  if (auto shifted = find_shift(expected, newest)) return shifted;
  const OffsetFit degrees = offset_.fit_degrees(used_shift_s_, newest);
  if (degrees.explains() && degrees.cost + kOffsetEvidence < expected.cost)
    return AgreementFinding{Kind::kDegrees, degrees};
  OffsetFit configured = offset_.fit(Axes::kConfigured, prior, TimeOffset::kTurns);
  if (!is_clock_known_) {
    const OffsetFit any = offset_.fit(Axes::kConfigured, {}, TimeOffset::kTurns);
    if (any.cost < configured.cost) configured = any;
  }
  return find_axes(configured);
}

bool CameraAgreement::is_as_expected(const OffsetFit& fit) const {
  const double sigma_s = std::hypot(tolerance_s() / kByFilter_sigma, fit.shift_sigma_s);
  return fit.explains() && std::abs(fit.shift_s - used_shift_s_) < kShift_sigma * sigma_s;
}

std::optional<AgreementFinding> CameraAgreement::find_shift(const OffsetFit& expected,
                                                            std::size_t newest) const {
  const OffsetFit shifted = offset_.fit(Axes::kConfigured, {}, newest);
  const auto is_beyond = [&](double from_s) {
    return std::abs(shifted.shift_s - from_s) >
           tolerance_s() + kShift_sigma * shifted.shift_sigma_s;
  };
  if (shifted.cost + kOffsetEvidence > expected.cost || !shifted.explains() || !shifted.is_unique ||
      !is_beyond(used_shift_s_) || std::abs(shifted.shift_s) > TimeOffset::kReach_s - kNearEnd_s)
    return {};
  const bool is_jump = is_clock_known_ || !is_beyond(start_shift_s_);
  return AgreementFinding{is_jump ? Kind::kJumped : Kind::kShifted, shifted};
}

/// Other axes, if they explain more than those of `configured`.
std::optional<AgreementFinding> CameraAgreement::find_axes(const OffsetFit& configured) const {
  const OffsetFit turned = offset_.fit(Axes::kTurned, {}, TimeOffset::kTurns);
  const OffsetFit reflected = offset_.fit(Axes::kReflected, {}, TimeOffset::kTurns);
  const bool is_turned = turned.cost <= reflected.cost;
  const OffsetFit& better = is_turned ? turned : reflected;
  if (better.cost + kOffsetEvidence < configured.cost) {
    if (!better.explains()) return {};
    const bool is_clear = std::abs(turned.cost - reflected.cost) > kOffsetEvidence;
    const Kind kind = is_turned ? Kind::kAxesTurned : Kind::kAxesReflected;
    return AgreementFinding{is_clear ? kind : Kind::kAxesApart, better};
  }
  // Turns about few axes agree with many causes and do not end a contradiction.
  const bool is_over = configured.cost + kOffsetEvidence < reflected.cost;
  if (!is_as_expected(configured) || (axes_are_wrong_ && !is_over)) return {};
  return AgreementFinding{Kind::kAgree, configured};
}

void CameraAgreement::note_agreement(const AgreementFinding& found) {
  if ((axes_are_wrong_ || reported_shift_s_) && found_again_ < kVerySure) return;
  has_degrees_ = false;
  reported_shift_s_.reset();
  is_clock_known_ |=
      found.fit.shift_sigma_s < kKnownShift_s && found.fit.axes_sigma_rad < kKnownAxes_rad;
  if (std::exchange(axes_are_wrong_, false)) new_finding_ = found;
  axes_reported_.reset();
}

/// Effective at once; reported when the cause is clear, or has stayed unclear.
void CameraAgreement::note_wrong_axes(const AgreementFinding& found) {
  axes_are_wrong_ = true;
  if (found.kind == Kind::kAxesApart && (axes_reported_ || found_again_ < kVerySure)) return;
  if (axes_reported_ && axes_reported_ != Kind::kAxesApart) return;
  axes_reported_ = found.kind;
  new_finding_ = found;
}

void CameraAgreement::note_jump(double shift_s) {
  reported_shift_s_ = used_shift_s_ = shift_s;
  is_clock_known_ = true;
  forget_turns();
}

/// They are of another clock.
void CameraAgreement::forget_turns() {
  offset_.forget_all();
  new_turns_ = 0;
  candidate_.reset();
}

bool CameraAgreement::shift_is_wrong() const {
  return reported_shift_s_ && std::abs(*reported_shift_s_ - used_shift_s_) > tolerance_s();
}

std::optional<AgreementFinding> CameraAgreement::take_finding() {
  return std::exchange(new_finding_, std::nullopt);
}

std::string agreement_text(int camera, const CameraMount& mount, const AgreementFinding& finding) {
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
          "the body about all three axes to find out which",
          camera, kWithheld);
    case Kind::kShifted:
      return shift_text(camera, mount, finding);
    case Kind::kJumped:
      return fmt::format(
          "the clock of camera {} has jumped by {:.2f} s against the IMU (stamps are now {:.2f} s "
          "{} than before); poses are withheld until this is corrected. Check what sets the clocks "
          "of camera and IMU",
          camera, std::abs(finding.jump_s), std::abs(finding.jump_s),
          finding.jump_s < 0 ? "later" : "earlier");
    case Kind::kDegrees:
      break;  // reported with the other faults of an IMU
  }
  return {};
}

RotationAgreement::RotationAgreement(const BodySensors& sensors, double corner_noise_px)
    : mounts_(sensors.cameras), gyro_(sensors.imu ? sensors.imu->gyro_range_rad_s : 0) {
  if (!sensors.imu) return;
  cameras_.reserve(mounts_.size());
  for (std::size_t i = 0; i < mounts_.size(); ++i) {
    const double start_shift_s = i < sensors.start_shifts_s.size() ? sensors.start_shifts_s[i] : 0;
    cameras_.emplace_back(mounts_[i], start_shift_s, corner_noise_px);
  }
}

void RotationAgreement::add(const ImuSample& imu) {
  if (!cameras_.empty() && is_sane(imu.sampled_at)) gyro_.add(imu);
}

void RotationAgreement::add(const TagObservations& seen, bool fits) {
  if (has(seen.camera) && is_sane(seen.exposed_at - seen.clock_shift))
    cameras_[static_cast<std::size_t>(seen.camera)].add(seen, gyro_, fits);
}

void RotationAgreement::set_used_shift(int camera, double shift_s) {
  if (has(camera)) cameras_[static_cast<std::size_t>(camera)].set_used_shift(shift_s);
}

std::string RotationAgreement::note_jump(const UpdateReport::ClockJump& jump) {
  if (!has(jump.camera)) return {};
  const auto camera = static_cast<std::size_t>(jump.camera);
  cameras_[camera].note_jump(jump.shift_s);
  clock_jump_ =
      ClockJump{jump.camera, gyro_.end(), from_seconds(jump.shift_s), from_seconds(jump.change_s)};
  AgreementFinding finding;
  finding.kind = AgreementFinding::Kind::kJumped;
  finding.fit.shift_s = jump.shift_s;
  finding.jump_s = jump.change_s;
  return agreement_text(jump.camera, mounts_[camera], finding);
}

std::optional<AgreementReport> RotationAgreement::take_report() {
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    const auto found = cameras_[i].take_finding();
    if (!found) continue;
    const int camera = static_cast<int>(i);
    if (found->kind == AgreementFinding::Kind::kJumped)
      clock_jump_ = ClockJump{camera, gyro_.end(), from_seconds(found->fit.shift_s),
                              from_seconds(found->jump_s)};
    return AgreementReport{camera, *found, agreement_text(camera, mounts_[i], *found)};
  }
  return {};
}

bool RotationAgreement::withholds() const {
  return std::ranges::any_of(cameras_,
                             [](const CameraAgreement& camera) { return camera.contradicts(); });
}

bool RotationAgreement::is_established() const {
  return !cameras_.empty() && std::ranges::all_of(cameras_, [](const CameraAgreement& camera) {
    return camera.is_established();
  });
}

}  // namespace fiducap
