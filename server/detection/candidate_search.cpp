#include "detection/candidate_search.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include <opencv2/imgproc.hpp>

#include "detection/tag_detector.hpp"
#include "detection/tag_family.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr int kMaxWidth_px = 960;  // of the image searched for squares
constexpr double kMinSide_px = 8;  // in that image
constexpr double kMinPixelsPerCell = 1.5;
constexpr double kFaintContrast = 24;  // grays
constexpr double kMinContrast = 6;     // of a square, grays
constexpr double kMaxBend = 0.05;      // of a side, relative to the perimeter
constexpr double kMinWidth = 0.3;      // between opposite sides, relative to the longest one
constexpr int kWindow_px = 23;         // of the local threshold; odd
constexpr double kOffset = 4;          // dark is this many grays below its window's mean

DetectorConfig lenient(DetectorConfig config) {
  config.min_decision_margin = 0;
  config.fit_sides = false;
  config.threads = 1;
  return config;
}

bool holds(const TagCorners& quad, const Eigen::Vector2d& px) {
  int left = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d along = quad[(i + 1) % 4] - quad[i];
    const Eigen::Vector2d to = px - quad[i];
    left += along.x() * to.y() - along.y() * to.x() > 0 ? 1 : -1;
  }
  return std::abs(left) == 4;
}

double gray_at(const GrayImage& image, const Eigen::Vector2d& px) {
  const long u = std::clamp(std::lround(px.x()), 0L, long{image.width} - 1);
  const long v = std::clamp(std::lround(px.y()), 0L, long{image.height} - 1);
  return image.pixels[static_cast<std::size_t>(v * image.width + u)];
}

/// Gray outside of the sides minus gray inside: mean over points at this share of the distance to
/// the middle, at least 1.5 px from the sides.
double contrast_of(const GrayImage& image, const TagCorners& quad, double share) {
  constexpr int kPoints = 6;  // per side
  constexpr double kClear_px = 1.5;
  const Eigen::Vector2d middle = centre_of(quad);
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    for (int k = 0; k < kPoints; ++k) {
      const double at = (k + 1.0) / (kPoints + 1);
      const Eigen::Vector2d px = (1 - at) * quad[i] + at * quad[(i + 1) % 4];
      const double away_px = (px - middle).norm();
      const Eigen::Vector2d off =
          (px - middle) * std::max(share, kClear_px / std::max(kClear_px, away_px));
      sum += gray_at(image, px + off) - gray_at(image, px - off);
    }
  }
  return sum / (4 * kPoints);
}

}  // namespace

class CandidateSearch::Impl {
 public:
  Impl(const TagSetConfig& tags, const DetectorConfig& config)
      : detector_(tags, lenient(config)),
        decimate_(config.decimate),
        min_margin_(config.min_decision_margin) {
    if (const auto family = TagFamily::named(tags.family)) {
      cells_ = family->edge_width();
      is_reversed_ = family->has_reversed_border();
    }
  }

  void search(const GrayImage& image, std::span<const TagSighting> found,
              std::vector<TagCandidate>& out) {
    out.clear();
    if (image.width < 8 || image.height < 8) return;
    taken_.clear();
    for (const TagSighting& tag : found) taken_.push_back(tag.corners_px);
    add_read(image, found, out);
    add_squares(image, out);
    std::ranges::sort(out, [](const TagCandidate& a, const TagCandidate& b) {
      const bool a_read = a.tag_id >= 0, b_read = b.tag_id >= 0;
      if (a_read != b_read) return a_read;
      return outline_of(a.corners_px).longest_px > outline_of(b.corners_px).longest_px;
    });
    if (out.size() > kMost) out.resize(kMost);
  }

 private:
  void add_read(const GrayImage& image, std::span<const TagSighting> found,
                std::vector<TagCandidate>& out) {
    read_.clear();
    detector_.detect(image, whole(image), {decimate_, 5}, read_);
    for (const TagSighting& tag : read_) {
      const bool is_found = std::ranges::any_of(found, [&](const TagSighting& one) {
        return one.tag_id == tag.tag_id && holds(one.corners_px, centre_of(tag.corners_px));
      });
      if (is_found) continue;
      taken_.push_back(tag.corners_px);
      const bool is_good = tag.decision_margin >= min_margin_;
      out.push_back({is_good ? TagCandidate::Why::kUnsearched : TagCandidate::Why::kLowMargin,
                     tag.tag_id, tag.hamming, tag.decision_margin, tag.corners_px});
    }
  }

  void add_squares(const GrayImage& image, std::vector<TagCandidate>& out) {
    // OpenCV takes a non-const pointer but only reads.
    const cv::Mat full(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
    const double scale = std::max(1.0, double(image.width) / kMaxWidth_px);
    if (scale > 1) {
      cv::resize(full, small_, {}, 1 / scale, 1 / scale, cv::INTER_AREA);
    } else {
      small_ = full;
    }
    cv::adaptiveThreshold(small_, dark_, 255, cv::ADAPTIVE_THRESH_MEAN_C, cv::THRESH_BINARY_INV,
                          kWindow_px, kOffset);
    contours_.clear();
    cv::findContours(dark_, contours_, cv::RETR_LIST, cv::CHAIN_APPROX_SIMPLE);
    // Larger ones first: squares within a square are its bits.
    std::ranges::sort(contours_, [](const auto& a, const auto& b) {
      return cv::boundingRect(a).area() > cv::boundingRect(b).area();
    });
    for (const auto& contour : contours_) {
      if (out.size() >= 2 * kMost) return;
      if (const auto quad = quad_of(contour, scale)) add_square(image, *quad, out);
    }
  }

  std::optional<TagCorners> quad_of(const std::vector<cv::Point>& contour, double scale) {
    const double perimeter = cv::arcLength(contour, true);
    if (perimeter < 4 * kMinSide_px) return std::nullopt;
    cv::approxPolyDP(contour, polygon_, kMaxBend * perimeter, true);
    if (polygon_.size() != 4 || !cv::isContourConvex(polygon_)) return std::nullopt;
    TagCorners quad;
    for (std::size_t i = 0; i < 4; ++i)
      quad[i] = (Eigen::Vector2d(polygon_[i].x, polygon_[i].y).array() + 0.5) * scale - 0.5;
    const TagOutline outline = outline_of(quad);
    if (outline.width_px < kMinWidth * outline.longest_px) return std::nullopt;
    return quad;
  }

  void add_square(const GrayImage& image, const TagCorners& quad, std::vector<TagCandidate>& out) {
    const Eigen::Vector2d middle = centre_of(quad);
    const bool is_taken = std::ranges::any_of(taken_, [&](const TagCorners& other) {
      return holds(other, middle) || holds(quad, centre_of(other));
    });
    if (is_taken) return;
    const double contrast = contrast_of(image, quad, 0.5 / cells_) * (is_reversed_ ? -1 : 1);
    if (contrast < kMinContrast) return;
    taken_.push_back(quad);
    const bool is_small = outline_of(quad).width_px < kMinPixelsPerCell * cells_;
    using Why = TagCandidate::Why;
    out.push_back({is_small                    ? Why::kTooSmall
                   : contrast < kFaintContrast ? Why::kFaint
                                               : Why::kUnread,
                   -1, 0, 0, quad});
  }

  TagDetector detector_;
  double decimate_;
  double min_margin_;
  int cells_{8};
  bool is_reversed_{false};
  std::vector<TagSighting> read_;
  std::vector<TagCorners> taken_;
  cv::Mat small_, dark_;
  std::vector<std::vector<cv::Point>> contours_;
  std::vector<cv::Point> polygon_;
};

CandidateSearch::CandidateSearch(const TagSetConfig& tags, const DetectorConfig& config)
    : impl_(std::make_unique<Impl>(tags, config)) {}
CandidateSearch::~CandidateSearch() = default;

void CandidateSearch::search(const GrayImage& image, std::span<const TagSighting> found,
                             std::vector<TagCandidate>& out) {
  impl_->search(image, found, out);
}

}  // namespace fiducap
