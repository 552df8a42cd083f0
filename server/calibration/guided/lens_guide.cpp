#include "calibration/guided/lens_guide.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/SVD>

namespace fiducap {
namespace {

constexpr int kColumns = 8;
constexpr int kPerCell = 2;  // corners; the same as in the verdict
constexpr double kEnoughCover = 0.9;
constexpr std::size_t kEnoughViews = 24;
constexpr double kSlanted = 0.906;         // cos 25°
constexpr std::size_t kEnoughSlanted = 8;  // views
constexpr double kStill = 0.004;           // of the width, from image to image: else it is smeared
constexpr double kUnlike = 0.03;           // of the width
constexpr double kBlurredBelow = 0.6;      // of the sharpest that was seen

double sharpness_of(const CalibrationView& view) {
  double least = 0;
  for (const TargetSighting& s : view.sightings)
    if (s.sharpness > 0) least = least == 0 ? s.sharpness : std::min(least, s.sharpness);
  return least;
}

/// The four outermost points of a target, in the order of a tag's corners.
std::optional<std::array<Eigen::Vector2d, 4>> outline_of(const TargetSighting& sighting) {
  if (sighting.points.size() != 4) return std::nullopt;
  std::array<Eigen::Vector2d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) corners[i] = sighting.points[i].raw_px;
  return corners;
}

bool is_slanted(const CalibrationView& view) {
  return std::any_of(view.sightings.begin(), view.sightings.end(), [](const TargetSighting& s) {
    const auto corners = outline_of(s);
    return corners && slant_cosine(*corners) < kSlanted;
  });
}

}  // namespace

double slant_cosine(const std::array<Eigen::Vector2d, 4>& c) {
  Eigen::Matrix2d affine;
  affine << (c[1] - c[0] + c[2] - c[3]) / 2, (c[3] - c[0] + c[2] - c[1]) / 2;
  const Eigen::Vector2d sizes = affine.jacobiSvd().singularValues();
  return sizes(0) > 0 ? sizes(1) / sizes(0) : 1;
}

LensGuide::LensGuide(CalibrationTargets targets, int width, int height)
    : collector_(std::move(targets)), width_(width), height_(height), wanted_(kEnoughViews) {
  progress_.columns = kColumns;
  progress_.rows = std::max(1, static_cast<int>(std::lround(1.0 * kColumns * height / width)));
  progress_.points.assign(static_cast<std::size_t>(progress_.columns * progress_.rows), 0);
  advise();
}

bool LensGuide::look(const std::shared_ptr<const GrayImage>& image) {
  return judge(collector_.look("image " + std::to_string(views_.size()), image));
}

bool LensGuide::look(const CornerFrame& corners) {
  return judge(collector_.look("image " + std::to_string(views_.size()), corners));
}

bool LensGuide::judge(std::optional<CalibrationView> view) {
  const CalibrationView before = std::exchange(last_, view.value_or(CalibrationView{}));
  last_said_.clear();
  bool kept = false;
  if (!view) {
    last_said_ = "Show the sheet to the camera.";
  } else if (views_.size() >= kMostViews) {
    last_said_ = "That is all that helps.";
  } else if (before.sightings.empty() || distance(before, *view, width_) > kStill) {
    last_said_ = "Hold it still for a moment.";
  } else if (!is_sharp(*view)) {
    last_said_ =
        "It is blurred: hold it still, nearer to where the lens is in focus, in more light.";
  } else if (is_new(*view)) {
    keep(*view);
    kept = true;
  }
  advise();
  return kept;
}

bool LensGuide::is_sharp(const CalibrationView& view) {
  const double sharpness = sharpness_of(view);
  if (sharpness <= 0) return true;  // a checkerboard's corners do not say
  sharpest_ = std::max(sharpest_, sharpness);
  return sharpness >= kBlurredBelow * sharpest_;
}

bool LensGuide::is_new(const CalibrationView& view) const {
  return std::all_of(views_.begin(), views_.end(), [&](const CalibrationView& kept) {
    return distance(kept, view, width_) > kUnlike;
  });
}

void LensGuide::keep(CalibrationView view) {
  count(view);
  if (is_slanted(view)) ++progress_.tilted;
  views_.push_back(std::move(view));
  progress_.views = views_.size();
}

void LensGuide::count(const CalibrationView& view) {
  for (const TargetSighting& s : view.sightings) {
    for (const SeenPoint& point : s.points) {
      const int column = static_cast<int>((point.raw_px.x() + 0.5) / width_ * progress_.columns);
      const int row = static_cast<int>((point.raw_px.y() + 0.5) / height_ * progress_.rows);
      if (column < 0 || row < 0 || column >= progress_.columns || row >= progress_.rows) continue;
      ++progress_.points[static_cast<std::size_t>(row * progress_.columns + column)];
    }
  }
  const auto full = std::count_if(progress_.points.begin(), progress_.points.end(),
                                  [](int n) { return n >= kPerCell; });
  progress_.covered = static_cast<double>(full) / static_cast<double>(progress_.points.size());
}

/// What is worst comes first.
void LensGuide::advise() {
  const bool is_covered = progress_.covered >= kEnoughCover;
  const bool is_tilted = progress_.tilted >= kEnoughSlanted;
  progress_.is_enough = (views_.size() >= wanted_ && is_covered && is_tilted && !views_.empty()) ||
                        views_.size() >= kMostViews;
  if (!last_said_.empty()) {
    progress_.hint = last_said_;
  } else if (progress_.is_enough) {
    progress_.hint = "Enough: the lens is solved for.";
  } else if (!is_tilted && views_.size() >= 4) {
    progress_.hint = "Slant the sheet: lean it by 30 to 50 degrees, to all sides.";
  } else if (!is_covered) {
    progress_.hint = "Move it to the " + missing_part() + " of the image, up to the border.";
  } else {
    progress_.hint = why_more_.empty() ? "A few more, from near and from far." : why_more_;
  }
}

/// The third of the image, in words, with the largest share of empty cells.
std::string LensGuide::missing_part() const {
  static const std::array<const char*, 3> kHeights{"upper", "middle", "lower"};
  static const std::array<const char*, 3> kSides{"left", "centre", "right"};
  std::array<std::array<double, 3>, 3> empty{}, cells{};
  for (int row = 0; row < progress_.rows; ++row) {
    for (int column = 0; column < progress_.columns; ++column) {
      const auto r = static_cast<std::size_t>(3 * row / progress_.rows);
      const auto c = static_cast<std::size_t>(3 * column / progress_.columns);
      cells[r][c] += 1;
      if (progress_.points[static_cast<std::size_t>(row * progress_.columns + column)] < kPerCell)
        empty[r][c] += 1;
    }
  }
  std::size_t best = 0;
  const auto share = [&](std::size_t i) {
    return cells[i / 3][i % 3] > 0 ? empty[i / 3][i % 3] / cells[i / 3][i % 3] : 0;
  };
  for (std::size_t i = 1; i < 9; ++i)
    if (share(i) > share(best)) best = i;
  return std::string(kHeights[best / 3]) + " " + kSides[best % 3];
}

CalibrationData LensGuide::data() const { return {width_, height_, collector_.targets(), views_}; }

void LensGuide::ask_for_more(std::size_t views, std::string why) {
  wanted_ = std::min(views_.size() + views, kMostViews);
  why_more_ = std::move(why);
  last_said_.clear();
  advise();
}

}  // namespace fiducap
