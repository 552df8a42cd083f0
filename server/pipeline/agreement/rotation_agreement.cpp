#include "pipeline/agreement/rotation_agreement.hpp"

#include <algorithm>
#include <utility>

namespace fiducap {

namespace {

/// Sums of such times do not overflow.
bool is_sane(Instant stamp) {
  constexpr std::int64_t kMost_ns = std::int64_t{1} << 62;
  return to_ns(stamp) > -kMost_ns && to_ns(stamp) < kMost_ns;
}

}  // namespace

RotationAgreement::RotationAgreement(const BodySensors& sensors, double corner_noise_px)
    : mounts_(sensors.cameras), gyro_(sensors.imu ? sensors.imu->gyro_range_rad_s : 0) {
  if (!sensors.imu) return;
  cameras_.reserve(mounts_.size());
  for (std::size_t i = 0; i < mounts_.size(); ++i) {
    const double told_s = i < sensors.start_shifts_s.size() ? sensors.start_shifts_s[i] : 0;
    cameras_.emplace_back(mounts_[i], told_s, corner_noise_px);
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

std::optional<AgreementNews> RotationAgreement::take_news() {
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    const auto found = cameras_[i].take_news();
    if (!found) continue;
    const int camera = static_cast<int>(i);
    if (found->kind == AgreementFinding::Kind::kJumped)
      clock_jump_ =
          ClockJump{camera, gyro_.end(), from_seconds(found->shift_s), from_seconds(found->jump_s)};
    return AgreementNews{camera, *found, agreement_text(camera, mounts_[i], *found)};
  }
  return {};
}

bool RotationAgreement::withholds() const {
  return std::any_of(cameras_.begin(), cameras_.end(),
                     [](const CameraAgreement& camera) { return camera.contradicts(); });
}

bool RotationAgreement::is_established() const {
  return !cameras_.empty() &&
         std::all_of(cameras_.begin(), cameras_.end(),
                     [](const CameraAgreement& camera) { return camera.is_established(); });
}

}  // namespace fiducap
