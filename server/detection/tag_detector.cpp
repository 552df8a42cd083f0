#include "detection/tag_detector.hpp"

extern "C" {
#include <apriltag/apriltag.h>
}

#include <algorithm>
#include <utility>

#include "base/assert.hpp"
#include "detection/corner_sigma.hpp"
#include "detection/negative_patch.hpp"
#include "detection/side_fit.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {

namespace {

/// A tag cut by the image border is decoded all the same, with corners that are pixels off and a
/// good margin.
constexpr double kBorder_px = 5.0;

bool is_whole(const TagSighting& tag, const ImageRegion& region) {
  return std::all_of(tag.corners_px.begin(), tag.corners_px.end(), [&](const Eigen::Vector2d& px) {
    return px.x() >= region.left + kBorder_px && px.y() >= region.top + kBorder_px &&
           px.x() <= region.right - 1 - kBorder_px && px.y() <= region.bottom - 1 - kBorder_px;
  });
}

/// The library works on tiles of this size; it takes no image that is smaller than one.
constexpr int kTile_px = 4;

/// The library counts pixel *edges*, we count centres.
constexpr double kEdgeToCentre_px = 0.5;
// Sides that are less sharp and could not be fitted are where the library says: a pixel off or
// more.
constexpr double kSmearedSharpness = 0.4;

TagFamily family_of(const TagSetConfig& tags) {
  auto family = TagFamily::named(tags.family);
  FIDUCAP_ASSERT(family);
  return std::move(*family);
}

TagSighting to_sighting(const apriltag_detection_t& d, const ImageRegion& region) {
  TagSighting out;
  out.tag_id = d.id;
  out.hamming = d.hamming;
  out.decision_margin = static_cast<double>(d.decision_margin);
  // The library's order is ours: lower-left, lower-right, upper-right, upper-left of the printed
  // tag.
  for (std::size_t i = 0; i < 4; ++i) {
    out.corners_px[i] = {d.p[i][0] - kEdgeToCentre_px + region.left,
                         d.p[i][1] - kEdgeToCentre_px + region.top};
  }
  return out;
}

}  // namespace

class TagDetector::Impl {
 public:
  Impl(const TagSetConfig& tags, const DetectorConfig& config)
      : family_(family_of(tags)),
        min_margin_(std::max(config.min_decision_margin, family_.facts().least_margin)),
        fits_sides_(config.fit_sides) {
    detector_ = apriltag_detector_create();
    apriltag_detector_add_family_bits(detector_, family_.handle(),
                                      std::min(config.max_hamming, family_.facts().most_corrected));
    detector_->nthreads = config.threads;
    detector_->quad_sigma = static_cast<float>(config.blur_sigma_px);
    detector_->refine_edges = config.refine_edges;
  }
  ~Impl() { apriltag_detector_destroy(detector_); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void detect(const GrayImage& image, const ImageRegion& region, const DetectionPass& pass,
              std::vector<TagSighting>& out) {
    if (std::min(region.width(), region.height()) < kTile_px * pass.decimate) return;
    detector_->quad_decimate = static_cast<float>(pass.decimate);
    detector_->qtp.min_white_black_diff = pass.contrast;
    const std::uint8_t* first =
        image.pixels.data() + std::size_t(region.top) * std::size_t(image.width) + region.left;
    // The library takes a non-const pointer but only reads the original image.
    image_u8_t view{region.width(), region.height(), image.width, const_cast<std::uint8_t*>(first)};
    zarray_t* found = apriltag_detector_detect(detector_, &view);
    for (int i = 0; i < zarray_size(found); ++i) {
      apriltag_detection_t* d = nullptr;
      zarray_get(found, i, &d);
      if (static_cast<double>(d->decision_margin) < min_margin_) continue;
      TagSighting sighting = to_sighting(*d, region);
      if (!is_whole(sighting, region)) continue;
      refine(image, sighting);
      out.push_back(sighting);
    }
    apriltag_detections_destroy(found);
  }

  [[nodiscard]] double outer_ring() const {
    return 0.5 * (family_.width() - family_.edge_width()) / family_.edge_width();
  }

 private:
  /// Corners where the sides are, and how well those were to be seen.
  void refine(const GrayImage& image, TagSighting& sighting) {
    const auto fitted = fits_sides_ ? fit(image, sighting.corners_px) : std::nullopt;
    if (fitted) sighting.corners_px = fitted->corners_px;
    sighting.sides = look_at_sides(image, sighting.corners_px, family_.edge_width(),
                                   family_.has_reversed_border());
    sighting.sharpness = least_sharpness(sighting.sides);
    for (std::size_t k = 0; fits_sides_ && k < 4; ++k) {
      TagSide& side = sighting.sides[k];
      if (fitted ? fitted->guessed[k] : side.sharpness < kSmearedSharpness) side.sharpness = 0;
    }
  }

  std::optional<FittedSides> fit(const GrayImage& image,
                                 std::array<Eigen::Vector2d, 4> corners_px) {
    const int modules = family_.edge_width();
    if (!family_.has_reversed_border()) return fit_sides(image, corners_px, modules);
    negative_.cut(image, corners_px, modules);
    for (Eigen::Vector2d& px : corners_px) px -= negative_.origin_px();
    auto fitted = fit_sides(negative_.image(), corners_px, modules);
    if (!fitted) return std::nullopt;
    for (Eigen::Vector2d& px : fitted->corners_px) px += negative_.origin_px();
    return fitted;
  }

  TagFamily family_;
  double min_margin_;
  bool fits_sides_;
  NegativePatch negative_;
  apriltag_detector_t* detector_{nullptr};
};

TagDetector::TagDetector(const TagSetConfig& tags, const DetectorConfig& config)
    : impl_(std::make_unique<Impl>(tags, config)), config_(config) {}
TagDetector::~TagDetector() = default;
TagDetector::TagDetector(TagDetector&&) noexcept = default;
TagDetector& TagDetector::operator=(TagDetector&&) noexcept = default;

CornerFrame TagDetector::detect(const CameraFrame& frame) {
  CornerFrame out{frame.camera, frame.exposed_at, {}, true};
  out.clock_shift = frame.clock_shift;
  if (frame.image == nullptr || frame.image->pixels.empty()) return out;
  detect(*frame.image, whole(*frame.image), {config_.decimate, config_.min_white_black_diff},
         out.tags);
  std::sort(out.tags.begin(), out.tags.end(),
            [](const auto& a, const auto& b) { return a.tag_id < b.tag_id; });
  return out;
}

void TagDetector::detect(const GrayImage& image, const ImageRegion& region,
                         const DetectionPass& pass, std::vector<TagSighting>& out) {
  FIDUCAP_ASSERT(region.left >= 0 && region.top >= 0 && region.right <= image.width &&
                 region.bottom <= image.height);
  impl_->detect(image, region, pass, out);
}

double TagDetector::outer_ring() const { return impl_->outer_ring(); }

}  // namespace fiducap
