#include "pipeline/agreement/pose_trust.hpp"

#include <bit>
#include <utility>

namespace fiducap {

namespace {

// Of the last ten images with tags to use, so many that contradict are not noise or a wrong id.
constexpr unsigned kLastImages = (1U << 10U) - 1;
constexpr int kContradicting = 3;
// What is believed has not been contradicted for so long, and has fitted so many images.
constexpr Duration kFitting = std::chrono::seconds(2);
constexpr int kFittingImages = 10;
// … or for so long, when nothing but the tag that brought the body back could be wrong.
constexpr Duration kFittingAlone = std::chrono::milliseconds(500);
// In a new room one image that contradicts makes everybody wait anew, but not for ever: ids are
// misread.
constexpr Duration kLongestDoubt = std::chrono::seconds(10);
constexpr Duration kWorthAWord = std::chrono::seconds(3);

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
  if (report.returned_alone && stage_ != Stage::kContradicted) {
    if (stage_ == Stage::kBelieved) stage_ = Stage::kReturned;
    last_ = 0;
    forget_fits();
  }
  if (stage_ != Stage::kReturned && is_established && !was_lost_) return believe();
  const int usable = report.tags_used + report.tags_rejected;
  if (usable == 0) return;
  // One tag for and one against is no proof for a body that has none yet.
  const bool needs_proof = stage_ != Stage::kBelieved && 2 * report.tags_rejected == usable;
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
  if (stage_ == Stage::kBelieved) return;
  const Duration fitting = stage_ == Stage::kReturned ? kFittingAlone : kFitting;
  const bool has_fitted = fits_ >= kFittingImages && now_ - *first_fit_ >= fitting;
  if (contradicts) return;
  if (has_fitted || (stage_ == Stage::kNew && is_room_known && !was_lost_)) believe();
}

void PoseTrust::note_clock_jump() {
  was_lost_ = true;
  last_ = 0;
  contradict();
  is_told_ = true;  // in words of its own
}

void PoseTrust::believe() {
  stage_ = Stage::kBelieved;
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
  is_told_ = false;
}

bool PoseTrust::take_news() {
  if (stage_ != Stage::kContradicted || is_told_ || now_ - contradicted_since_ < kWorthAWord)
    return false;
  return is_told_ = true;
}

std::string contradiction_text(bool is_established) {
  if (is_established)
    return "images contradicted where the body was: it is looked for anew, and poses are withheld "
           "until images fit for two seconds. Were tags moved, or is an id there twice?";
  return "images contradict what the IMU says of the motion, and the body has not turned enough to "
         "tell whether axes and clocks are right; poses are withheld. Turn the body about all "
         "three axes: it will be said what is wrong, or poses come back";
}

}  // namespace fiducap
