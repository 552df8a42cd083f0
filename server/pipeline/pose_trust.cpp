#include "pipeline/pose_trust.hpp"

#include <bit>
#include <utility>

#include <fmt/format.h>

namespace fiducap {
namespace {

// Of the last ten images with usable tags: this number of contradictions is no noise and no wrong
// id.
constexpr unsigned kLastImages = (1U << 10U) - 1;
constexpr int kContradicting = 3;
// A pose is trusted after this time without contradiction and this number of fitting images …
constexpr Duration kFitting = std::chrono::seconds(2);
constexpr int kFittingImages = 10;
// … or this one, when only the tag of the relocalisation could be wrong.
constexpr Duration kFittingAlone = std::chrono::milliseconds(500);
// In a new room one contradicting image restarts the window, because ids may be misread, but the
// window never exceeds this.
constexpr Duration kLongestDoubt = std::chrono::seconds(10);
constexpr Duration kReportedAfter = std::chrono::seconds(3);

constexpr int kImagesInARow = 50;
constexpr Duration kExcludedAfter = std::chrono::seconds(2);
constexpr Duration kInTime = std::chrono::milliseconds(200);  // well within the merger's window

constexpr Duration kSilent = std::chrono::milliseconds(500);
// No reading of this long was as new as the images: neither jitter nor a burst.
constexpr Duration kLagging = std::chrono::milliseconds(100);
constexpr Duration kLagPeriod = std::chrono::milliseconds(100);

}  // namespace

void PoseTrust::add(const UpdateReport& report, bool is_established, bool is_room_known) {
  now_ = report.exposed_at;
  const bool has_restarted = generation_ >= 0 && report.generation != generation_;
  generation_ = report.generation;
  if (has_restarted || report.relocalised) {
    was_lost_ = true;
    last_ = 0;
    return stage_ == Stage::kNew ? forget_fits() : contradict();
  }
  if (report.relocalised_by_one_tag && stage_ != Stage::kContradicted) {
    if (stage_ == Stage::kTrusted) stage_ = Stage::kReturned;
    last_ = 0;
    forget_fits();
  }
  if (stage_ != Stage::kReturned && is_established && !was_lost_) return trust();
  const int usable = report.tags_used + report.tags_rejected;
  if (usable == 0) return;
  // One tag for and one against proves nothing.
  const bool needs_proof = stage_ != Stage::kTrusted && 2 * report.tags_rejected == usable;
  const bool contradicts = needs_proof || 2 * report.tags_rejected > usable;
  last_ = ((last_ << 1U) | (contradicts ? 1U : 0U)) & kLastImages;
  if (std::popcount(last_) >= kContradicting) {
    was_lost_ |= stage_ == Stage::kReturned;
    return contradict();
  }
  if (!first_image_) first_image_ = now_;
  const bool is_doubted = stage_ == Stage::kNew && now_ - *first_image_ < kLongestDoubt;
  if (contradicts && is_doubted) return forget_fits();
  fits_ += contradicts ? 0 : 1;
  if (!first_fit_) first_fit_ = now_;
  if (stage_ == Stage::kTrusted) return;
  const Duration fitting = stage_ == Stage::kReturned ? kFittingAlone : kFitting;
  const bool has_fitted = fits_ >= kFittingImages && now_ - *first_fit_ >= fitting;
  if (contradicts) return;
  if (has_fitted || (stage_ == Stage::kNew && is_room_known && !was_lost_)) trust();
}

void PoseTrust::note_clock_jump() {
  was_lost_ = true;
  last_ = 0;
  contradict();
  is_explained_ = true;
}

void PoseTrust::trust() {
  stage_ = Stage::kTrusted;
  was_lost_ = false;
  last_ = 0;
}

void PoseTrust::forget_fits() {
  fits_ = 0;
  first_fit_.reset();
}

void PoseTrust::contradict() {
  forget_fits();
  if (std::exchange(stage_, Stage::kContradicted) == Stage::kContradicted) return;
  contradicted_since_ = now_;
  is_explained_ = false;
}

bool PoseTrust::is_contradicted() const {
  return stage_ == Stage::kContradicted && !is_explained_ &&
         now_ - contradicted_since_ >= kReportedAfter;
}

std::string contradiction_text(bool is_established) {
  if (is_established)
    return "images contradicted the pose of the body: it is relocalised, and poses are withheld "
           "until images fit for two seconds. Were tags moved, or is an id used twice?";
  return "images contradict the motion measured by the IMU, and the body has not turned enough to "
         "decide whether axes and clocks are right; poses are withheld. Turn the body about all "
         "three axes: the cause is then reported, or poses come back";
}

LateImages::Change LateImages::note(int camera, Instant stamp, bool was_dropped,
                                    Instant newest_imu) {
  if (camera < 0 || static_cast<std::size_t>(camera) >= cameras_.size()) return Change::kNone;
  Camera& of = cameras_[static_cast<std::size_t>(camera)];
  const bool counts = of.is_excluded ? newest_imu - stamp < kInTime : was_dropped;
  if (!counts || of.in_a_row == 0) of.since = stamp;
  of.in_a_row = counts ? of.in_a_row + 1 : 0;
  if (of.in_a_row < kImagesInARow || stamp - of.since < kExcludedAfter) return Change::kNone;
  of.in_a_row = 0;
  of.is_excluded = !of.is_excluded;
  if (of.is_excluded) {
    of.behind = newest_imu - stamp;
    return Change::kExcluded;
  }
  of.excluded_until = stamp;
  return Change::kInTime;
}

std::string LateImages::text(int camera) const {
  return fmt::format(
      "images of camera {} are stamped {:.2f} s before IMU readings that arrived earlier: they are "
      "too late to be used, and poses are withheld. Correct bodies[].cameras[].time_shift_s, or "
      "the clocks of camera and IMU; turn the body about all three axes to measure the offset",
      camera, to_seconds(cameras_[static_cast<std::size_t>(camera)].behind));
}

void ImuSilence::reading_arrived(Instant sampled_at) {
  if (!newest_image_) return;
  arrived_at_ = newest_image_;
  if (sampled_at - lag_.since > kLagPeriod || sampled_at < lag_.since)
    lag_before_ = std::exchange(lag_, {.since = sampled_at});
  lag_.least = std::min(lag_.least, *newest_image_ - sampled_at);
}

void ImuSilence::image_used(Instant exposed_at, Instant stamp) {
  if (!used_at_) used_at_ = exposed_at;
  const Duration uncovered = exposed_at - *used_at_;
  lags_ = uncovered > kLagging && std::min(lag_.least, lag_before_.least) > kLagging &&
          arrived_at_ && stamp - *arrived_at_ < kSilent;
  is_silent_ = lags_ || uncovered > kSilent;
}

std::string_view ImuSilence::text() const {
  if (!is_silent_) return "the IMU is back";
  if (lags_)
    return "images are stamped later than all readings of the IMU: poses are withheld. Check the "
           "clocks of camera and IMU, and whether readings arrive late";
  return "the IMU is silent: images are used without it, poses between them are guesses. Check its "
         "cable, driver and clock";
}

}  // namespace fiducap
