#include "capture/image_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "base/text.hpp"

namespace fiducap {
namespace {

using Histogram = std::array<std::uint32_t, 256>;

constexpr int kPixelStep = 8;  // of both axes, for the histogram and hashes
constexpr int kEdgeRows = 12;  // between rows searched for edges
constexpr int kEdgeColumns = 4;
constexpr int kReach = 8;   // pixels, over which a clear edge …
constexpr int kClear = 60;  // … rises by this much: more than noise
constexpr int kWithin = 2;

const std::uint8_t* row_of(const GrayImage& image, int v) {
  return image.pixels.data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width);
}

int quantile_of(const Histogram& histogram, double share) {
  std::uint64_t all = 0;
  for (const std::uint32_t count : histogram) all += count;
  double left = share * static_cast<double>(all);
  for (std::size_t value = 0; value < histogram.size(); ++value) {
    left -= histogram[value];
    if (left <= 0 && histogram[value] > 0) return static_cast<int>(value);
  }
  return 255;
}

/// Histogram; hash and contrast of each band go to `out`.
Histogram scan_pixels(const GrayImage& image, ImageTraits& out) {
  Histogram histogram{};
  std::array<int, ImageTraits::kBands> least{}, most{};
  least.fill(255);
  for (int v = 0; v < image.height; v += kPixelStep) {
    const auto band =
        static_cast<std::size_t>(v) * ImageTraits::kBands / static_cast<std::size_t>(image.height);
    const std::uint8_t* row = row_of(image, v);
    std::uint64_t hash = out.bands[band];
    for (int u = 0; u < image.width; u += kPixelStep) {
      ++histogram[row[u]];
      hash = (hash ^ row[u]) * 0x100000001b3;  // FNV-1a
      least[band] = std::min<int>(least[band], row[u]);
      most[band] = std::max<int>(most[band], row[u]);
    }
    out.bands[band] = hash;
  }
  constexpr int kHardly = 8;
  for (std::size_t band = 0; band < ImageTraits::kBands; ++band)
    out.is_plain[band] = most[band] - least[band] < kHardly;
  return histogram;
}

/// Histogram of the largest two-pixel step of each edge, in hundredths of the edge's rise.
class EdgeSteps final {
 public:
  /// @param stride  between two pixels across the edge
  void add(const std::uint8_t* pixel, std::ptrdiff_t stride) {
    const int rise = pixel[kReach * stride] - pixel[0];
    if (std::abs(rise) < kClear) return;
    int largest = 0;
    for (int i = 0; i + kWithin <= kReach; ++i) {
      const int step = pixel[(i + kWithin) * stride] - pixel[i * stride];
      largest = std::max(largest, rise > 0 ? step : -step);
    }
    const int hundredths = std::clamp(100 * largest / std::abs(rise), 0, 100);
    ++steps_[static_cast<std::size_t>(hundredths)];
    ++edges_;
  }
  /// The sharper ones count: some edges are always out of focus.
  [[nodiscard]] double sharpness() const {
    constexpr std::uint32_t kLeast = 40;
    if (edges_ < kLeast) return 0;
    std::uint32_t left = edges_ / 5;
    for (std::size_t i = steps_.size(); i-- > 0;) {
      if (steps_[i] >= left) return static_cast<double>(i) / 100;
      left -= steps_[i];
    }
    return 0;
  }

 private:
  std::array<std::uint32_t, 101> steps_{};
  std::uint32_t edges_{0};
};

void scan_edges(const GrayImage& image, ImageTraits& out) {
  EdgeSteps across, down;
  for (int v = 0; v + kReach < image.height; v += kEdgeRows) {
    const std::uint8_t* row = row_of(image, v);
    for (int u = 0; u + kReach < image.width; u += kEdgeColumns) across.add(row + u, 1);
    for (int u = 0; u < image.width; u += kEdgeColumns) down.add(row + u, image.width);
  }
  out.across = across.sharpness();
  out.down = down.sharpness();
}

/// Share of the pixels of a row.
double share_of_value(const GrayImage& image, int v, std::uint8_t value) {
  const std::uint8_t* row = row_of(image, v);
  return static_cast<double>(std::count(row, row + image.width, value)) / image.width;
}

/// Rows of a single value at one end. @param step  1: at the upper end, -1: at the lower
int rows_of_one_value(const GrayImage& image, int step) {
  int v = step > 0 ? 0 : image.height - 1;
  const std::uint8_t value = *row_of(image, v);
  int rows = 0;
  while (rows < image.height && share_of_value(image, v, value) == 1) {
    ++rows;
    v += step;
  }
  if (rows == 0 || rows == image.height) return 0;
  // A dark or white part of the scene ends raggedly; memory that was never filled ends in one row.
  // The missing part of a JPEG is gray, and ends within a block of 16 rows.
  const bool is_at_end = value <= 2 || value >= 253;
  const double ragged = is_at_end ? 0.2 : 0.5;
  const int beyond = v + step * (is_at_end ? 1 : 16);
  if (beyond < 0 || beyond >= image.height) return 0;
  return share_of_value(image, beyond, value) < ragged ? rows : 0;
}

// The contrast of a tag must exceed noise.
constexpr int kTooDark = 30;
constexpr double kTooWhite = 0.5;
constexpr double kMissingPart = 0.08;
// Share of a step within two of eight pixels: a blur of 2.5 px (1-sigma) or a smear of 8 px.
constexpr double kBlurred = 0.5;
constexpr double kRateTolerance = 0.25;

struct FaultRule {
  double begins, ends;  ///< Share of time.
  double memory_s;
  std::string_view name, over, remedy;
};

/// In the order of ImageFault.
constexpr std::array<FaultRule, kImageFaults> kRules{{
    {0.9, 0.5, 1.0, "image_dark", "its images are bright enough again",
     "More light, or a longer exposure or more gain (exposure_s, gain)"},
    {0.9, 0.5, 1.0, "image_overexposed", "its images are no longer white",
     "A shorter exposure or less gain"},
    {0.95, 0.3, 0.3, "image_frozen", "its images change again",
     "Unplug it and plug it in again; if that does not help, change cable, hub or camera"},
    {0.15, 0.05, 3.0, "image_duplicated", "its images are no longer repeated",
     "Request a rate that it supports (rate_hz), or a shorter exposure"},
    {0.03, 0.005, 5.0, "image_half", "its images are complete again",
     "Change the cable or the USB port, use no hub, or request a smaller size or rate"},
    {0.5, 0.1, 0.1, "image_size", "its images have the calibrated size again",
     "Set width and height to those of the calibration, or calibrate this size"},
    {0.9, 0.3, 2.0, "image_rate", "its rate is as configured again",
     "Set rate_hz to the actual rate; exposure: manual, if it is slow in the dark"},
    {0.05, 0.01, 5.0, "image_lost", "its images arrive without gaps again",
     "A less busy computer, a smaller size or rate, or another USB bus"},
    {0.9, 0.6, 3.0, "image_unfocused", "its images are sharp again",
     "Turn the lens until edges are sharp, clean it; focus: a number instead of auto"},
    {0.35, 0.15, 5.0, "image_motion_blur", "its images are sharp again",
     "A shorter exposure with more light or gain, or slower motion"},
}};

std::string percent(double share) { return fixed(100 * share, 0) + " %"; }

std::size_t index_of(ImageFault fault) { return static_cast<std::size_t>(fault); }

}  // namespace

ImageTraits traits_of(const GrayImage& image) {
  ImageTraits out;
  const Histogram histogram = scan_pixels(image, out);
  constexpr double kTwentieth = 0.05;
  out.dark = quantile_of(histogram, kTwentieth);
  out.bright = quantile_of(histogram, 1 - kTwentieth);
  constexpr std::size_t kWhite = 250;
  std::uint64_t all = 0, white = 0;
  for (std::size_t value = 0; value < histogram.size(); ++value) {
    all += histogram[value];
    if (value >= kWhite) white += histogram[value];
  }
  out.white = static_cast<double>(white) / static_cast<double>(all);
  const int rows = std::max(rows_of_one_value(image, 1), rows_of_one_value(image, -1));
  out.missing = static_cast<double>(rows) / image.height;
  scan_edges(image, out);
  return out;
}

std::string_view name_of(ImageFault fault) { return kRules[index_of(fault)].name; }

void LastingShare::add(bool is_so, double since_last_s) {
  const double weight = 1 - std::exp(-since_last_s / limits_.memory_s);
  share_ += weight * ((is_so ? 1.0 : 0.0) - share_);
  holds_ = holds_ ? share_ > limits_.ends : share_ >= limits_.begins;
}

ImageWatch::ImageWatch(Nominal nominal) : nominal_(nominal) {
  for (const FaultRule& rule : kRules)
    shares_.emplace_back(LastingShare::Limits{rule.begins, rule.ends, rule.memory_s});
  changes_.reserve(kImageFaults);
}

bool ImageWatch::holds(ImageFault fault) const { return holds_[index_of(fault)]; }

std::span<const ImageCondition> ImageWatch::take(const CameraFrame& frame) {
  changes_.clear();
  if (!frame.image || frame.image->pixels.empty()) return changes_;
  const ImageTraits now = traits_of(*frame.image);
  // After a longer gap the device was reopened, which is reported elsewhere.
  constexpr double kAway_s = 5;
  constexpr double kLongestGap_s = 1;
  const double gap_s = last_at_ ? to_seconds(frame.exposed_at - *last_at_) : 0;
  if (gap_s > 0 && gap_s < kAway_s) {
    seen_s_ += gap_s;
    mean_gap_s_ += (1 - std::exp(-gap_s / kRules[index_of(ImageFault::kRate)].memory_s)) *
                   (gap_s - mean_gap_s_);
    if (seen_s_ == gap_s) mean_gap_s_ = gap_s;
    check(frame, now, std::min(gap_s, kLongestGap_s));
    report_changes(frame);
  }
  last_at_ = frame.exposed_at;
  last_ = now;
  return changes_;
}

void ImageWatch::add(ImageFault fault, bool is_so, double since_last_s) {
  shares_[index_of(fault)].add(is_so, since_last_s);
}

void ImageWatch::check(const CameraFrame& frame, const ImageTraits& now, double since_last_s) {
  add(ImageFault::kDark, now.bright < kTooDark, since_last_s);
  add(ImageFault::kOverexposed, now.white > kTooWhite, since_last_s);
  const PixelSize size{frame.image->width, frame.image->height};
  add(ImageFault::kSize, nominal_.size.width != 0 && size != nominal_.size, since_last_s);
  check_repetition(now, since_last_s);
  if (now.across > 0 && now.down > 0) {  // images without clear edges are not used
    const bool across = now.across < kBlurred, down = now.down < kBlurred;
    add(ImageFault::kUnfocused, across && down, since_last_s);
    add(ImageFault::kMotionBlur, across || down, since_last_s);
  }
  check_flow(frame, since_last_s);
}

/// All pixels equal those of the image before, or those below some row.
void ImageWatch::check_repetition(const ImageTraits& now, double since_last_s) {
  std::size_t usable = 0, equal = 0;
  bool upper_differs = false, lower_equal = false;
  for (std::size_t band = 0; band < ImageTraits::kBands; ++band) {
    if (now.is_plain[band]) continue;
    ++usable;
    const bool same = now.bands[band] == last_->bands[band];
    equal += same;
    lower_equal = same;
    if (!same) upper_differs = true;
  }
  const bool is_same = usable > 0 && equal == usable;
  const bool is_torn = equal > 0 && upper_differs && lower_equal;
  add(ImageFault::kFrozen, is_same, since_last_s);
  // A second repetition in a row counts as frozen only.
  add(ImageFault::kDuplicated, is_same && !was_same_, since_last_s);
  was_same_ = is_same;
  add(ImageFault::kHalf, is_torn || now.missing > kMissingPart, since_last_s);
}

void ImageWatch::check_flow(const CameraFrame& frame, double since_last_s) {
  constexpr double kSettled_s = 2;
  const double ratio = nominal_.rate_hz * mean_gap_s_;  // above 1: too slow
  add(ImageFault::kRate,
      nominal_.rate_hz > 0 && seen_s_ > kSettled_s &&
          (ratio > 1 / (1 - kRateTolerance) || ratio < 1 / (1 + kRateTolerance)),
      since_last_s);
  // Each lost image counts for its share of the gap.
  const double shares = frame.lost_before + 1.0;
  add(ImageFault::kLost, false, since_last_s / shares);
  if (frame.lost_before > 0)
    add(ImageFault::kLost, true, since_last_s * frame.lost_before / shares);
}

void ImageWatch::report_changes(const CameraFrame& frame) {
  const auto is_on = [this](ImageFault fault) { return shares_[index_of(fault)].holds(); };
  for (std::size_t i = 0; i < kImageFaults; ++i) {
    const auto fault = static_cast<ImageFault>(i);
    bool holds = shares_[i].holds();
    // Of two with the same cause only the worse one is reported.
    if (fault == ImageFault::kDuplicated) holds = holds && !is_on(ImageFault::kFrozen);
    if (fault == ImageFault::kMotionBlur) holds = holds && !is_on(ImageFault::kUnfocused);
    if (std::exchange(holds_[i], holds) == holds) continue;
    changes_.push_back({fault, holds, holds ? text_of(fault, frame) : std::string(kRules[i].over),
                        holds ? std::string(kRules[i].remedy) : std::string()});
  }
}

std::string ImageWatch::text_of(ImageFault fault, const CameraFrame& frame) const {
  const double share = shares_[index_of(fault)].share();
  switch (fault) {
    case ImageFault::kDark:
      return "its images are too dark to see tags (night, a lens cap, a very short exposure)";
    case ImageFault::kOverexposed:
      return "more than half of its image is white (exposure or gain too high, a lamp or the sun "
             "in view)";
    case ImageFault::kFrozen:
      return "gives the same image again and again with new stamps: it, or its driver, hangs";
    case ImageFault::kDuplicated:
      return percent(share) +
             " of its images repeat the one before with a new stamp (it does not support this "
             "rate, or exposes too long for it)";
    case ImageFault::kHalf:
      return percent(share) +
             " of its images are incomplete, or end with the one before (cable, hub, power, a full "
             "USB bus)";
    case ImageFault::kSize:
      return "gives images of " + size_text(frame.image->width, frame.image->height) +
             ", expected are " + size_text(nominal_.size);
    case ImageFault::kRate:
      return "gives " + fixed(1 / mean_gap_s_, 1) + " images a second instead of " +
             fixed(nominal_.rate_hz, 1) +
             (nominal_.rate_hz * mean_gap_s_ > 1
                  ? " (an automatic exposure in the dark, a full USB bus, a busy computer)"
                  : " (another mode than was configured)");
    case ImageFault::kLost:
      return percent(share) + " of its images are missing (a full USB bus, a busy computer)";
    case ImageFault::kUnfocused:
      return "all edges in its images are blurred (out of focus, or the lens is dirty or fogged)";
    case ImageFault::kMotionBlur:
      break;
  }
  return "edges are blurred in " + percent(share) +
         " of its images (motion during a long exposure)";
}

}  // namespace fiducap
