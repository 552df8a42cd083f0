#include "capture/image_watch.hpp"

#include <algorithm>
#include <cmath>

#include "base/text.hpp"

namespace fiducap {
namespace {

// A tag needs a difference between white and black that noise does not reach.
constexpr int kTooDark = 30;
constexpr double kTooWhite = 0.5;
constexpr double kMissingPart = 0.08;
// Of a step seen over eight pixels, within two: a blur of 2.5 px (1-sigma) or a smear of 8 px.
constexpr double kSmeared = 0.5;
constexpr double kRateTolerance = 0.25;

using Limits = LastingShare::Limits;

/// In the order of ImageFault. How much of the time begins it, ends it, and over which time.
constexpr std::array<Limits, kImageFaults> kLimits{{
    {0.9, 0.5, 1.0},     // dark
    {0.9, 0.5, 1.0},     // overexposed
    {0.95, 0.3, 0.3},    // frozen
    {0.15, 0.05, 3.0},   // duplicated
    {0.03, 0.005, 5.0},  // half
    {0.5, 0.1, 0.1},     // size
    {0.9, 0.3, 2.0},     // rate
    {0.05, 0.01, 5.0},   // lost
    {0.9, 0.6, 3.0},     // unfocused
    {0.35, 0.15, 5.0},   // motion blur
}};

struct Words {
  std::string_view name;
  std::string_view over;
  std::string_view remedy;
};

constexpr std::array<Words, kImageFaults> kWords{{
    {"image_dark", "its images are bright enough again",
     "More light, or a longer exposure or more gain (exposure_s, gain)"},
    {"image_overexposed", "its images are no longer white", "A shorter exposure or less gain"},
    {"image_frozen", "its images change again",
     "Unplug it and plug it in again; if it comes back, change cable, hub or camera"},
    {"image_duplicated", "its images are no longer repeated",
     "Ask for a rate that it can do (rate_hz), or for a shorter exposure"},
    {"image_half", "its images are whole again",
     "Change the cable or the USB port, use no hub, or ask for a smaller size or rate"},
    {"image_size", "its images have the calibrated size again",
     "Set width and height to those of the calibration, or calibrate this size"},
    {"image_rate", "its rate is as configured again",
     "Set rate_hz to what it gives; exposure: manual, if it is slow in the dark"},
    {"image_lost", "its images come again without gaps",
     "Another USB bus, a smaller size or rate, or a less busy computer"},
    {"image_unfocused", "its images are sharp again",
     "Turn the lens until edges are sharp, clean "
     "it; focus: a number instead of auto"},
    {"image_motion_blur", "its images are sharp again",
     "A shorter exposure with more light or gain, or slower motion"},
}};

std::string percent(double share) { return fixed(100 * share, 0) + " %"; }

std::size_t index_of(ImageFault fault) { return static_cast<std::size_t>(fault); }

}  // namespace

std::string_view name_of(ImageFault fault) { return kWords[index_of(fault)].name; }

void LastingShare::add(bool is_so, double since_last_s) {
  const double weight = 1 - std::exp(-since_last_s / limits_.memory_s);
  share_ += weight * ((is_so ? 1.0 : 0.0) - share_);
  holds_ = holds_ ? share_ > limits_.ends : share_ >= limits_.begins;
}

ImageWatch::ImageWatch(Promise promise) : promise_(promise) {
  for (const Limits& limits : kLimits) shares_.emplace_back(limits);
  doubts_.reserve(kImageFaults);
}

bool ImageWatch::holds(ImageFault fault) const { return said_[index_of(fault)]; }

std::span<const ImageDoubt> ImageWatch::take(const CameraFrame& frame) {
  doubts_.clear();
  if (!frame.image || frame.image->pixels.empty()) return doubts_;
  const ImageTraits now = traits_of(*frame.image);
  // After so long the device was away and was opened anew, which others say: no gap to be judged.
  constexpr double kAway_s = 5;
  constexpr double kLongestGap_s = 1;
  const double gap_s = last_at_ ? to_seconds(frame.exposed_at - *last_at_) : 0;
  if (gap_s > 0 && gap_s < kAway_s) {
    seen_s_ += gap_s;
    mean_gap_s_ += (1 - std::exp(-gap_s / kLimits[index_of(ImageFault::kRate)].memory_s)) *
                   (gap_s - mean_gap_s_);
    if (seen_s_ == gap_s) mean_gap_s_ = gap_s;
    judge(frame, now, std::min(gap_s, kLongestGap_s));
    say_changes(frame);
  }
  last_at_ = frame.exposed_at;
  last_ = now;
  return doubts_;
}

void ImageWatch::add(ImageFault fault, bool is_so, double since_last_s) {
  shares_[index_of(fault)].add(is_so, since_last_s);
}

void ImageWatch::judge(const CameraFrame& frame, const ImageTraits& now, double since_last_s) {
  add(ImageFault::kDark, now.bright < kTooDark, since_last_s);
  add(ImageFault::kOverexposed, now.white > kTooWhite, since_last_s);
  const PixelSize size{frame.image->width, frame.image->height};
  add(ImageFault::kSize, promise_.size.width != 0 && size != promise_.size, since_last_s);
  judge_repetition(now, since_last_s);
  judge_sharpness(now, since_last_s);
  judge_flow(frame, since_last_s);
}

/// Pixels that are all the same as those of the image before, or from some row on.
void ImageWatch::judge_repetition(const ImageTraits& now, double since_last_s) {
  std::size_t telling = 0, equal = 0;
  bool upper_differs = false, lower_equal = false;
  for (std::size_t band = 0; band < ImageTraits::kBands; ++band) {
    if (now.is_plain[band]) continue;
    ++telling;
    const bool same = now.bands[band] == last_->bands[band];
    equal += same;
    lower_equal = same;
    if (!same) upper_differs = true;
  }
  const bool is_same = telling > 0 && equal == telling;
  const bool is_torn = equal > 0 && upper_differs && lower_equal;
  add(ImageFault::kFrozen, is_same, since_last_s);
  // One that repeats a repetition is on its way to be frozen.
  add(ImageFault::kDuplicated, is_same && !was_same_, since_last_s);
  was_same_ = is_same;
  add(ImageFault::kHalf, is_torn || now.missing > kMissingPart, since_last_s);
}

/// What is too dark or has no edges says nothing about the lens.
void ImageWatch::judge_sharpness(const ImageTraits& now, double since_last_s) {
  if (now.across == 0 || now.down == 0) return;
  const bool across = now.across < kSmeared, down = now.down < kSmeared;
  add(ImageFault::kUnfocused, across && down, since_last_s);
  add(ImageFault::kMotionBlur, across || down, since_last_s);
}

void ImageWatch::judge_flow(const CameraFrame& frame, double since_last_s) {
  constexpr double kSettled_s = 2;
  const double ratio = promise_.rate_hz * mean_gap_s_;  // above 1: too slow
  add(ImageFault::kRate,
      promise_.rate_hz > 0 && seen_s_ > kSettled_s &&
          (ratio > 1 / (1 - kRateTolerance) || ratio < 1 / (1 + kRateTolerance)),
      since_last_s);
  // Each lost image counts as one that came to nothing, over its share of the gap.
  const double shares = frame.lost_before + 1.0;
  add(ImageFault::kLost, false, since_last_s / shares);
  if (frame.lost_before > 0)
    add(ImageFault::kLost, true, since_last_s * frame.lost_before / shares);
}

void ImageWatch::say_changes(const CameraFrame& frame) {
  const auto stands = [this](ImageFault fault) { return shares_[index_of(fault)].holds(); };
  for (std::size_t i = 0; i < kImageFaults; ++i) {
    const auto fault = static_cast<ImageFault>(i);
    bool holds = shares_[i].holds();
    // Of two that have the same cause only the worse one is said.
    if (fault == ImageFault::kDuplicated) holds = holds && !stands(ImageFault::kFrozen);
    if (fault == ImageFault::kMotionBlur) holds = holds && !stands(ImageFault::kUnfocused);
    if (holds == said_[i]) continue;
    said_[i] = holds;
    doubts_.push_back({fault, holds, holds ? text_of(fault, frame) : std::string(kWords[i].over),
                       holds ? std::string(kWords[i].remedy) : std::string()});
  }
}

std::string ImageWatch::text_of(ImageFault fault, const CameraFrame& frame) const {
  const double share = shares_[index_of(fault)].share();
  switch (fault) {
    case ImageFault::kDark:
      return "its images are too dark to see tags (night, a lens cap, a very short exposure)";
    case ImageFault::kOverexposed:
      return "more than half of its images is white (exposure or gain too high, a lamp or the sun "
             "in view)";
    case ImageFault::kFrozen:
      return "gives the same image again and again with new stamps: it, or its driver, hangs";
    case ImageFault::kDuplicated:
      return percent(share) +
             " of its images are the one before with a new stamp (it cannot do this rate, or "
             "exposes longer than the rate allows)";
    case ImageFault::kHalf:
      return percent(share) +
             " of its images lack a part, or end with the one before (cable, hub, power, a full "
             "USB bus)";
    case ImageFault::kSize:
      return "gives images of " + std::to_string(frame.image->width) + " x " +
             std::to_string(frame.image->height) + ", expected are " +
             std::to_string(promise_.size.width) + " x " + std::to_string(promise_.size.height);
    case ImageFault::kRate:
      return "gives " + fixed(1 / mean_gap_s_, 1) + " images a second instead of " +
             fixed(promise_.rate_hz, 1) +
             (promise_.rate_hz * mean_gap_s_ > 1
                  ? " (an automatic exposure in the dark, a full USB bus, a busy computer)"
                  : " (another mode than was configured)");
    case ImageFault::kLost:
      return percent(share) + " of its images are missing (a full USB bus, a busy computer)";
    case ImageFault::kUnfocused:
      return "all edges in its images are smeared (out of focus, or the lens is dirty or fogged)";
    case ImageFault::kMotionBlur:
      break;
  }
  return "edges are smeared in " + percent(share) +
         " of its images (motion during a long exposure)";
}

}  // namespace fiducap
