#include "pipeline/agreement/rotation_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "base/numeric.hpp"
#include "base/pose.hpp"

namespace fiducap {
namespace {

using Kind = AgreementFinding::Kind;

// Span of a turn: longer ones are more accurate, within the first order.
constexpr Duration kShortest = std::chrono::milliseconds(190);
constexpr Duration kBest = std::chrono::milliseconds(300);
constexpr Duration kLongest = std::chrono::milliseconds(520);
constexpr Duration kImagePeriod = std::chrono::milliseconds(90);
constexpr Duration kFurthest = std::chrono::milliseconds(800);
constexpr Duration kOnTheWay = std::chrono::milliseconds(250);
// Smaller turns are noise.
constexpr double kSmallestTurn_rad = 0.05;

constexpr std::size_t kFewestPairs = 10;
constexpr std::size_t kPairsPerJudgement = 3;
// Judgements in a row that find the same.
constexpr int kSure = 2;
constexpr int kVerySure = 6;
constexpr double kShiftTolerance_s = 0.06;
constexpr double kSureShift_s = 0.035;
constexpr double kSureAxes_rad = 0.14;
constexpr double kRightAxes_rad = 0.26;
// Tracking of the clock's drift: weight of the newest turns.
constexpr double kFollow = 0.1;
constexpr double kDrift_s = 0.03;
constexpr double kSameShift_s = 0.05;
constexpr double kSameAxes_rad = 0.26;

bool are_the_same(const AgreementFinding& a, const AgreementFinding& b) {
  return a.kind == b.kind && std::abs(a.shift_s - b.shift_s) < kSameShift_s &&
         (a.kind == Kind::kAxesApart || (a.A - b.A).norm() < 2 * kSameAxes_rad);
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
  const Eigen::Quaterniond turn_V(Eigen::Matrix3d(R_BV.transpose() * finding.A * R_BV));
  const Eigen::Quaterniond right(Eigen::Matrix3d(finding.A * R_BV));
  const Eigen::Vector3d turn = log_so3(turn_V.normalized());
  return fmt::format(
      "camera {} looks along other axes than configured: turned by {:.0f}° about {}, by the gyro; "
      "{}Correct bodies[].cameras[].X_BV (the rotations fit with q_wxyz: [{:.2f}, {:.2f}, {:.2f}, "
      "{:.2f}], good to {:.0f}°; `fiducap calibrate extrinsics` refines it), or the axes of the "
      "IMU if all cameras are turned",
      camera, turn.norm() * kDegreesPerRadian, axis_text(turn.normalized()), kWithheld, right.w(),
      right.x(), right.y(), right.z(), std::ceil(3 * finding.axes_sigma_rad * kDegreesPerRadian));
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
  const std::string given = axes_given(finding.A);
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
      camera, std::abs(finding.shift_s), finding.shift_s < 0 ? "late" : "early",
      configured_s + finding.shift_s, finding.shift_sigma_s, configured_s, mount.time_shift_sigma_s,
      kWithheld, configured_s + finding.shift_s);
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
      corner_noise_px_(corner_noise_px),
      start_shift_s_(start_shift_s),
      tolerance_s_(std::max(5 * mount.time_shift_sigma_s, kShiftTolerance_s)),
      used_shift_s_(start_shift_s) {
  pairs_.reserve(kMostPairs);
}

bool CameraAgreement::wants(Instant stamp) const {
  if (images_taken_ == 0) return true;
  const Instant last = images_[(images_taken_ - 1) % kImages].at;
  return stamp < last || stamp - last >= kImagePeriod;
}

void CameraAgreement::add(const TagObservations& seen, const GyroIntegral& gyro) {
  const Instant stamp = seen.exposed_at - seen.clock_shift;
  if (!wants(stamp)) return;
  if (images_taken_ > 0 && stamp < image(images_taken_ - 1).at) images_taken_ = images_paired_ = 0;
  image(images_taken_++).take(seen);
  pair_up(gyro);
}

/// The images whose turns the gyro covers for every shift.
void CameraAgreement::pair_up(const GyroIntegral& gyro) {
  constexpr std::size_t kReach = 6;  // images within the longest turn
  if (images_taken_ > kImages)
    images_paired_ = std::max(images_paired_, images_taken_ - kImages + kReach);
  for (; images_paired_ < images_taken_; ++images_paired_) {
    const LargestTags& now = image(images_paired_);
    // By stamps first, so that a replay with another order of arrival gives the same.
    if (now.at + kFurthest + kOnTheWay > image(images_taken_ - 1).at) return;
    if (now.at + kFurthest > gyro.end()) return;
    pair(now, images_paired_, gyro);
  }
}

void CameraAgreement::pair(const LargestTags& now, std::size_t number, const GyroIntegral& gyro) {
  const std::size_t oldest = images_taken_ > kImages ? images_taken_ - kImages : 0;
  const LargestTags* before = nullptr;
  for (std::size_t i = number; i > oldest && now.at - image(i - 1).at <= kLongest; --i) {
    const LargestTags& other = image(i - 1);
    if (other.count == 0 || now.at - other.at < kShortest) continue;
    if (before == nullptr || now.at - other.at <= kBest) before = &other;
  }
  if (before == nullptr || now.count == 0) return;
  if (!gyro.covers(before->at - kFurthest, now.at + kFurthest)) return;
  TurnPair pair;
  double largest_rad = 0;
  for (std::size_t lag = 0; lag < lags::kCount; ++lag) {
    const Duration shift = from_seconds(lags::seconds(lag));
    const Eigen::Vector3d turn = *gyro.turn(before->at + shift, now.at + shift);
    largest_rad = std::max(largest_rad, turn.norm());
    pair.gyro[lag] = turn.cast<float>();
  }
  if (largest_rad < kSmallestTurn_rad) return;
  const auto turn = turn_between(*before, now, mount_.model, corner_noise_px_);
  if (!turn) return;
  pair.camera = mount_.X_BV.q * turn->turn_V;
  pair.sigma_rad = turn->sigma_rad;
  const double least_rad = std::max(kSmallestTurn_rad, 2 * turn->sigma_rad);
  if (pair.camera.norm() < least_rad && largest_rad < least_rad) return;
  if (pairs_.size() == kMostPairs) pairs_.erase(pairs_.begin());
  pairs_.push_back(pair);
  ++new_pairs_;
  if (pairs_.size() >= kFewestPairs && new_pairs_ >= kPairsPerJudgement) judge();
}

void CameraAgreement::judge() {
  new_pairs_ = 0;
  const std::optional<AgreementFinding> found =
      find_cause(pairs_, {known_shift_s_.value_or(start_shift_s_),
                          known_shift_s_ ? kShiftTolerance_s : tolerance_s_,
                          known_shift_s_.has_value(), axes_are_wrong_});
  const bool again = found && candidate_ && are_the_same(*found, *candidate_);
  found_again_ = again ? found_again_ + 1 : 1;
  candidate_ = found;
  if (!found || found_again_ < kSure) return;
  if (found->kind == Kind::kAgree) return note_agreement(*found);
  if (found->kind != Kind::kShifted && found->kind != Kind::kJumped) return note_wrong_axes(*found);
  new_finding_ = found;
  new_finding_->jump_s = known_shift_s_ ? found->shift_s - *known_shift_s_ : 0;
  known_shift_s_ = found->shift_s;
  shift_was_reported_ = true;
}

/// Turns about few axes agree with many causes and do not end a contradiction.
void CameraAgreement::note_agreement(const AgreementFinding& found) {
  const bool is_sure = found.shift_sigma_s < kSureShift_s && found.axes_sigma_rad < kSureAxes_rad;
  const bool is_over = is_sure && found_again_ >= kVerySure && found.angle_rad() < kRightAxes_rad;
  if (axes_are_wrong_ && !is_over) return;
  if (is_sure && !known_shift_s_) known_shift_s_ = found.shift_s;
  if (is_sure && std::abs(found.shift_s - *known_shift_s_) < kDrift_s)
    *known_shift_s_ += kFollow * (found.shift_s - *known_shift_s_);
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

/// Earlier turns are of another clock.
void CameraAgreement::note_jump(double shift_s) {
  known_shift_s_ = used_shift_s_ = shift_s;
  shift_was_reported_ = true;
  images_taken_ = images_paired_ = 0;
  pairs_.clear();
  new_pairs_ = 0;
  candidate_.reset();
  found_again_ = 0;
}

bool CameraAgreement::shift_is_wrong() const {
  return shift_was_reported_ && known_shift_s_ &&
         std::abs(*known_shift_s_ - used_shift_s_) > kShiftTolerance_s;
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

bool RotationAgreement::wants(int camera, Instant stamp) const {
  return has(camera) && is_sane(stamp) && cameras_[static_cast<std::size_t>(camera)].wants(stamp);
}

void RotationAgreement::add(const TagObservations& seen) {
  if (wants(seen.camera, seen.exposed_at - seen.clock_shift))
    cameras_[static_cast<std::size_t>(seen.camera)].add(seen, gyro_);
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
  finding.shift_s = jump.shift_s;
  finding.jump_s = jump.change_s;
  return agreement_text(jump.camera, mounts_[camera], finding);
}

std::optional<AgreementReport> RotationAgreement::take_report() {
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    const auto found = cameras_[i].take_finding();
    if (!found) continue;
    const int camera = static_cast<int>(i);
    if (found->kind == AgreementFinding::Kind::kJumped)
      clock_jump_ =
          ClockJump{camera, gyro_.end(), from_seconds(found->shift_s), from_seconds(found->jump_s)};
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
