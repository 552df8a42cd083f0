#include "calibration/guided/guides.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/SVD>

namespace fiducap {
namespace {

constexpr int kColumns = 8;
constexpr int kPerCell = 2;  // corners, as in the verdict
constexpr double kEnoughCover = 0.9;
constexpr std::size_t kEnoughViews = 24;
constexpr double kSlanted = 0.906;         // cos 25°
constexpr std::size_t kEnoughSlanted = 8;  // views
constexpr double kMaxMotion = 0.004;       // between images, in widths
constexpr double kMinDistance = 0.03;      // of different views, in widths
constexpr double kMinSharpness = 0.6;      // relative to the sharpest view

double sharpness_of(const CalibrationView& view) {
  double least = 0;
  for (const TargetSighting& s : view.sightings)
    if (s.sharpness > 0) least = least == 0 ? s.sharpness : std::min(least, s.sharpness);
  return least;
}

/// Nullopt for a target other than a tag.
std::optional<TagCorners> tag_corners_of(const TargetSighting& sighting) {
  if (sighting.points.size() != 4) return std::nullopt;
  TagCorners corners;
  for (std::size_t i = 0; i < 4; ++i) corners[i] = sighting.points[i].raw_px;
  return corners;
}

bool is_slanted(const CalibrationView& view) {
  return std::ranges::any_of(view.sightings, [](const TargetSighting& s) {
    const auto corners = tag_corners_of(s);
    return corners && slant_cosine(*corners) < kSlanted;
  });
}

}  // namespace

double slant_cosine(const TagCorners& c) {
  Eigen::Matrix2d affine;
  affine << (c[1] - c[0] + c[2] - c[3]) / 2, (c[3] - c[0] + c[2] - c[1]) / 2;
  const Eigen::Vector2d sizes = affine.jacobiSvd().singularValues();
  return sizes(0) > 0 ? sizes(1) / sizes(0) : 1;
}

LensGuide::LensGuide(CalibrationTargets targets, int width, int height)
    : no_tag_(targets.tags),
      collector_(std::move(targets)),
      width_(width),
      height_(height),
      required_views_(kEnoughViews) {
  progress_.columns = kColumns;
  progress_.rows = std::max(1, static_cast<int>(std::lround(1.0 * kColumns * height / width)));
  progress_.points.assign(static_cast<std::size_t>(progress_.columns * progress_.rows), 0);
  advise();
}

bool LensGuide::look(const std::shared_ptr<const GrayImage>& image) {
  auto view = collector_.look("image " + std::to_string(views_.size()), image);
  no_tag_.note(image, view.has_value());
  return consider(std::move(view));
}

bool LensGuide::look(const CornerFrame& corners) {
  return consider(collector_.look("image " + std::to_string(views_.size()), corners));
}

bool LensGuide::consider(std::optional<CalibrationView> view) {
  const CalibrationView before = std::exchange(last_, view.value_or(CalibrationView{}));
  problem_.clear();
  bool kept = false;
  if (!view) {
    problem_ = no_tag_.why().empty() ? "Show the sheet to the camera."
                                     : "No tag is found: " + no_tag_.why() + ".";
  } else if (views_.size() >= kMostViews) {
    problem_ = "Enough images: more do not improve the lens.";
  } else if (before.sightings.empty() || distance(before, *view, width_) > kMaxMotion) {
    problem_ = "Hold it still for a moment.";
  } else if (!is_sharp(*view)) {
    problem_ = "It is blurred: hold it still, in focus, with more light.";
  } else if (std::ranges::all_of(views_, [&](const CalibrationView& other) {
               return distance(other, *view, width_) > kMinDistance;
             })) {
    count(*view);
    views_.push_back(std::move(*view));
    progress_.views = views_.size();
    kept = true;
  }
  advise();
  return kept;
}

bool LensGuide::is_sharp(const CalibrationView& view) {
  const double sharpness = sharpness_of(view);
  if (sharpness <= 0) return true;  // unknown for a checkerboard
  sharpest_ = std::max(sharpest_, sharpness);
  return sharpness >= kMinSharpness * sharpest_;
}

void LensGuide::count(const CalibrationView& view) {
  if (is_slanted(view)) ++progress_.tilted;
  for (const TargetSighting& s : view.sightings) {
    for (const SeenPoint& point : s.points) {
      const int column = static_cast<int>((point.raw_px.x() + 0.5) / width_ * progress_.columns);
      const int row = static_cast<int>((point.raw_px.y() + 0.5) / height_ * progress_.rows);
      if (column < 0 || row < 0 || column >= progress_.columns || row >= progress_.rows) continue;
      ++progress_.points[static_cast<std::size_t>(row * progress_.columns + column)];
    }
  }
  const auto full = std::ranges::count_if(progress_.points, [](int n) { return n >= kPerCell; });
  progress_.covered = static_cast<double>(full) / static_cast<double>(progress_.points.size());
}

void LensGuide::advise() {
  const bool is_covered = progress_.covered >= kEnoughCover;
  const bool is_tilted = progress_.tilted >= kEnoughSlanted;
  progress_.is_enough =
      (views_.size() >= required_views_ && is_covered && is_tilted && !views_.empty()) ||
      views_.size() >= kMostViews;
  if (!problem_.empty()) {
    progress_.hint = problem_;
  } else if (progress_.is_enough) {
    progress_.hint = "Enough: solving for the lens.";
  } else if (!is_tilted && views_.size() >= 4) {
    progress_.hint = "Slant the sheet by 30 to 50 degrees, to all sides.";
  } else if (!is_covered) {
    progress_.hint = "Move it to the " + missing_part() + " of the image, up to the border.";
  } else {
    progress_.hint = request_.empty() ? "A few more images, from near and from far." : request_;
  }
}

/// Name of the part of the image (a third of width and height) with the largest share of empty
/// cells.
std::string LensGuide::missing_part() const {
  static const std::array<const char*, 3> kHeights{"upper", "middle", "lower"};
  static const std::array<const char*, 3> kSides{"left", "centre", "right"};
  std::array<double, 9> empty{}, cells{};
  for (std::size_t i = 0; i < progress_.points.size(); ++i) {
    const int row = static_cast<int>(i) / progress_.columns;
    const int column = static_cast<int>(i) % progress_.columns;
    const int part = 3 * (3 * row / progress_.rows) + 3 * column / progress_.columns;
    cells[static_cast<std::size_t>(part)] += 1;
    if (progress_.points[i] < kPerCell) empty[static_cast<std::size_t>(part)] += 1;
  }
  const auto share = [&](std::size_t i) { return cells[i] > 0 ? empty[i] / cells[i] : 0; };
  std::size_t best = 0;
  for (std::size_t i = 1; i < 9; ++i)
    if (share(i) > share(best)) best = i;
  return std::string(kHeights[best / 3]) + " " + kSides[best % 3];
}

CalibrationData LensGuide::data() const { return {width_, height_, collector_.targets(), views_}; }

void LensGuide::request_more(std::size_t views, std::string why) {
  required_views_ = std::min(views_.size() + views, kMostViews);
  request_ = std::move(why);
  problem_.clear();
  advise();
}

}  // namespace fiducap
