#include "pipeline/agreement/camera_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fiducap {

namespace {

using Kind = AgreementFinding::Kind;

// Turns are taken over about this: longer ones are better known, up to where first orders end.
constexpr Duration kShortest = std::chrono::milliseconds(190);
constexpr Duration kBest = std::chrono::milliseconds(300);
constexpr Duration kLongest = std::chrono::milliseconds(520);
constexpr Duration kLookPeriod = std::chrono::milliseconds(90);
constexpr Duration kFurthest = std::chrono::milliseconds(800);
constexpr Duration kOnTheWay = std::chrono::milliseconds(250);
// A turn that says something: above what noise makes of none.
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
// Of a clock's drift: what the last turns say moves what is known by this share.
constexpr double kFollow = 0.1;
constexpr double kDrift_s = 0.03;
constexpr double kSameShift_s = 0.05;
constexpr double kSameAxes_rad = 0.26;

bool are_the_same(const AgreementFinding& a, const AgreementFinding& b) {
  return a.kind == b.kind && std::abs(a.shift_s - b.shift_s) < kSameShift_s &&
         (a.kind == Kind::kAxesApart || (a.A - b.A).norm() < 2 * kSameAxes_rad);
}

}  // namespace

CameraAgreement::CameraAgreement(const CameraMount& mount, double told_shift_s,
                                 double corner_noise_px)
    : mount_(mount),
      corner_noise_px_(corner_noise_px),
      told_shift_s_(told_shift_s),
      tolerance_s_(std::max(5 * mount.time_shift_sigma_s, kShiftTolerance_s)),
      used_shift_s_(told_shift_s) {
  pairs_.reserve(kMostPairs);
}

bool CameraAgreement::wants(Instant stamp) const {
  if (looks_taken_ == 0) return true;
  const Instant last = looks_[(looks_taken_ - 1) % kLooks].at;
  return stamp < last || stamp - last >= kLookPeriod;
}

void CameraAgreement::add(const TagObservations& seen, const GyroIntegral& gyro) {
  const Instant stamp = seen.exposed_at - seen.clock_shift;
  if (!wants(stamp)) return;
  if (looks_taken_ > 0 && stamp < look(looks_taken_ - 1).at) looks_taken_ = looks_paired_ = 0;
  look(looks_taken_++).take(seen);
  pair_up(gyro);
}

/// The looks whose turns the gyro now knows for every shift.
void CameraAgreement::pair_up(const GyroIntegral& gyro) {
  constexpr std::size_t kReach = 6;  // looks that lie within the longest turn
  if (looks_taken_ > kLooks)
    looks_paired_ = std::max(looks_paired_, looks_taken_ - kLooks + kReach);
  for (; looks_paired_ < looks_taken_; ++looks_paired_) {
    const Look& now = look(looks_paired_);
    // By stamps first, so that a replay, whose readings come at other moments, does the same.
    if (now.at + kFurthest + kOnTheWay > look(looks_taken_ - 1).at) return;
    if (now.at + kFurthest > gyro.end()) return;
    pair(now, looks_paired_, gyro);
  }
}

void CameraAgreement::pair(const Look& now, std::size_t number, const GyroIntegral& gyro) {
  const std::size_t oldest = looks_taken_ > kLooks ? looks_taken_ - kLooks : 0;
  const Look* before = nullptr;
  for (std::size_t i = number; i > oldest && now.at - look(i - 1).at <= kLongest; --i) {
    const Look& other = look(i - 1);
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
      find_cause(pairs_, {known_shift_s_.value_or(told_shift_s_),
                          known_shift_s_ ? kShiftTolerance_s : tolerance_s_,
                          known_shift_s_.has_value(), axes_are_wrong_});
  const bool again = found && candidate_ && are_the_same(*found, *candidate_);
  found_again_ = again ? found_again_ + 1 : 1;
  candidate_ = found;
  if (found && found_again_ >= kSure) conclude(*found);
}

void CameraAgreement::conclude(const AgreementFinding& found) {
  switch (found.kind) {
    case Kind::kAgree:
      return note_agreement(found);
    case Kind::kShifted:
    case Kind::kJumped: {
      AgreementFinding said = found;
      said.jump_s = known_shift_s_ ? found.shift_s - *known_shift_s_ : 0;
      known_shift_s_ = found.shift_s;
      shift_was_named_ = true;
      return say(said);
    }
    default:
      return note_wrong_axes(found);
  }
}

/// A body that turns about few axes agrees with much: that does not end a contradiction.
void CameraAgreement::note_agreement(const AgreementFinding& found) {
  const bool is_sure = found.shift_sigma_s < kSureShift_s && found.axes_sigma_rad < kSureAxes_rad;
  const bool is_over = is_sure && found_again_ >= kVerySure && found.angle_rad() < kRightAxes_rad;
  if (axes_are_wrong_ && !is_over) return;
  if (is_sure && !known_shift_s_) known_shift_s_ = found.shift_s;
  if (is_sure && std::abs(found.shift_s - *known_shift_s_) < kDrift_s)
    *known_shift_s_ += kFollow * (found.shift_s - *known_shift_s_);
  if (std::exchange(axes_are_wrong_, false)) say(found);
  axes_said_.reset();
}

/// Believed at once, said when it is clear what is wrong, or stays unclear.
void CameraAgreement::note_wrong_axes(const AgreementFinding& found) {
  axes_are_wrong_ = true;
  if (found.kind == Kind::kAxesApart && (axes_said_ || found_again_ < kVerySure)) return;
  if (axes_said_ && axes_said_ != Kind::kAxesApart) return;
  axes_said_ = found.kind;
  say(found);
}

/// Turns that were seen before tell of another clock.
void CameraAgreement::note_jump(double shift_s) {
  known_shift_s_ = used_shift_s_ = shift_s;
  shift_was_named_ = true;
  looks_taken_ = looks_paired_ = 0;
  pairs_.clear();
  new_pairs_ = 0;
  candidate_.reset();
  found_again_ = 0;
}

bool CameraAgreement::shift_is_wrong() const {
  return shift_was_named_ && known_shift_s_ &&
         std::abs(*known_shift_s_ - used_shift_s_) > kShiftTolerance_s;
}

std::optional<AgreementFinding> CameraAgreement::take_news() {
  return std::exchange(news_, std::nullopt);
}

}  // namespace fiducap
