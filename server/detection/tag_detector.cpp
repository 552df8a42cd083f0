#include "detection/tag_detector.hpp"

extern "C" {
#include <apriltag/apriltag.h>
}

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/expected.hpp"
#include "detection/corner_sigma.hpp"
#include "detection/other_families.hpp"
#include "detection/side_fit.hpp"
#include "detection/tag_family.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

/// A tag cut by the image border has a good margin, but corners that are pixels off.
constexpr double kCutBorder_px = 5.0;

bool is_whole(const TagSighting& tag, const ImageRegion& region) {
  return std::ranges::all_of(tag.corners_px, [&](const Eigen::Vector2d& px) {
    return px.x() >= region.left + kCutBorder_px && px.y() >= region.top + kCutBorder_px &&
           px.x() <= region.right - 1 - kCutBorder_px &&
           px.y() <= region.bottom - 1 - kCutBorder_px;
  });
}

constexpr int kMinRegion_px = 4;  // libapriltag's tile; it accepts no smaller image

/// Libapriltag's origin is the corner of the first pixel, ours its centre.
constexpr double kEdgeToCentre_px = 0.5;
// Below this sharpness, corners without a fit are a pixel off or more.
constexpr double kBlurredSharpness = 0.4;

// Reach of side_fit beyond a tag: cells of the longest side, and pixels.
constexpr double kPatchMargin = 3.0;
constexpr double kPatchMargin_px = 8.0;
constexpr int kWhitest = 255;

/// A tag and its surroundings with black and white exchanged: turns a white border inside a black
/// one into the usual border, for one fit of sides. Keeps its memory.
class NegativePatch final {
 public:
  /// @param cells  along the edge
  void cut(const GrayImage& image, const TagCorners& corners_px, int cells) {
    const PixelBox box = bounds_of(corners_px);
    const double longest_px = outline_of(corners_px).longest_px;
    const double around_px = kPatchMargin_px + kPatchMargin * longest_px / cells;
    const auto clip = [](double px, int size) {
      return static_cast<int>(std::clamp(px, 0.0, double(size)));
    };
    const ImageRegion part{clip(std::floor(box.low.x() - around_px), image.width),
                           clip(std::floor(box.low.y() - around_px), image.height),
                           clip(std::ceil(box.high.x() + around_px) + 1, image.width),
                           clip(std::ceil(box.high.y() + around_px) + 1, image.height)};
    origin_px_ = {part.left, part.top};
    negative_.resize(std::max(0, part.width()), std::max(0, part.height()));
    auto out = negative_.pixels.begin();
    for (int row = part.top; row < part.bottom; ++row) {
      const auto first = image.pixels.begin() + std::ptrdiff_t{row} * image.width;
      out = std::transform(first + part.left, first + part.right, out, [](std::uint8_t gray) {
        return static_cast<std::uint8_t>(kWhitest - gray);
      });
    }
  }

  [[nodiscard]] const GrayImage& image() const { return negative_; }
  /// Of the patch's first pixel, in the image it was cut from.
  [[nodiscard]] const Eigen::Vector2d& origin_px() const { return origin_px_; }

 private:
  GrayImage negative_;
  Eigen::Vector2d origin_px_{0, 0};
};

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
  // The library has our order of corners.
  for (std::size_t i = 0; i < 4; ++i)
    out.corners_px[i] = {d.p[i][0] - kEdgeToCentre_px + region.left,
                         d.p[i][1] - kEdgeToCentre_px + region.top};
  return out;
}

}  // namespace

class TagDetector::Impl {
 public:
  Impl(const TagSetConfig& tags, const DetectorConfig& config)
      : family_(family_of(tags)),
        min_margin_(std::max(config.min_decision_margin, family_.facts().min_margin)),
        fits_sides_(config.fit_sides) {
    detector_ = apriltag_detector_create();
    apriltag_detector_add_family_bits(
        detector_, family_.handle(),
        std::min(config.max_hamming, family_.facts().max_corrected_bits));
    detector_->nthreads = config.threads;
    detector_->quad_sigma = static_cast<float>(config.blur_sigma_px);
    detector_->refine_edges = config.refine_edges;
  }
  ~Impl() { apriltag_detector_destroy(detector_); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void detect(const GrayImage& image, const ImageRegion& region, const DetectionPass& pass,
              std::vector<TagSighting>& out) {
    if (std::min(region.width(), region.height()) < kMinRegion_px * pass.decimate) return;
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
  /// Fits the sides and measures their sharpness.
  void refine(const GrayImage& image, TagSighting& sighting) {
    const auto fitted = fits_sides_ ? fit(image, sighting.corners_px) : std::nullopt;
    if (fitted) sighting.corners_px = fitted->corners_px;
    sighting.sides = measure_sides(image, sighting.corners_px, family_.edge_width(),
                                   family_.has_reversed_border());
    sighting.sharpness = least_sharpness(sighting.sides);
    for (std::size_t k = 0; fits_sides_ && k < 4; ++k) {
      TagSide& side = sighting.sides[k];
      if (fitted ? fitted->guessed[k] : side.sharpness < kBlurredSharpness) side.sharpness = 0;
    }
  }

  std::optional<FittedSides> fit(const GrayImage& image, TagCorners corners_px) {
    const int cells = family_.edge_width();
    if (!family_.has_reversed_border()) return fit_sides(image, corners_px, cells);
    negative_.cut(image, corners_px, cells);
    for (Eigen::Vector2d& px : corners_px) px -= negative_.origin_px();
    auto fitted = fit_sides(negative_.image(), corners_px, cells);
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
  std::ranges::sort(out.tags, {}, &TagSighting::tag_id);
  return out;
}

void TagDetector::detect(const GrayImage& image, const ImageRegion& region,
                         const DetectionPass& pass, std::vector<TagSighting>& out) {
  FIDUCAP_ASSERT(region.left >= 0 && region.top >= 0 && region.right <= image.width &&
                 region.bottom <= image.height);
  impl_->detect(image, region, pass, out);
}

double TagDetector::outer_ring() const { return impl_->outer_ring(); }

class AnyFamilyDetector::Impl {
 public:
  Impl() {
    families_.push_back(std::move(*TagFamily::named(kAprilGridFamily)));
    for (const TagFamilyFacts& facts : tag_families())
      families_.push_back(std::move(*TagFamily::named(std::string(facts.name))));
    for (const TagFamily& family : families_)
      apriltag_detector_add_family_bits(detector_.get(), family.handle(), 0);
  }

  void detect(const GrayImage& image, const DetectionPass& pass, std::vector<FamilySighting>& out) {
    if (std::min(image.width, image.height) < kMinRegion_px * pass.decimate) return;
    detector_->quad_decimate = static_cast<float>(pass.decimate);
    detector_->qtp.min_white_black_diff = pass.contrast;
    image_u8_t view{image.width, image.height, image.width,
                    const_cast<std::uint8_t*>(image.pixels.data())};
    zarray_t* found = apriltag_detector_detect(detector_.get(), &view);
    for (int i = 0; i < zarray_size(found); ++i) {
      apriltag_detection_t* d = nullptr;
      zarray_get(found, i, &d);
      const TagSighting tag = to_sighting(*d, whole(image));
      const auto family = std::ranges::find(families_, d->family,
                                            [](const TagFamily& one) { return one.handle(); });
      if (is_whole(tag, whole(image))) out.push_back({&family->facts(), tag});
    }
    apriltag_detections_destroy(found);
  }

 private:
  std::vector<TagFamily> families_;
  std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> detector_{
      apriltag_detector_create(), apriltag_detector_destroy};
};

AnyFamilyDetector::AnyFamilyDetector() : impl_(std::make_unique<Impl>()) {}
AnyFamilyDetector::~AnyFamilyDetector() = default;

void AnyFamilyDetector::detect(const GrayImage& image, const DetectionPass& pass,
                               std::vector<FamilySighting>& out) {
  impl_->detect(image, pass, out);
}

}  // namespace fiducap
