#include "detection/tag_search.hpp"

#include <algorithm>
#include <cmath>

#include "detection/image_measures.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr int kTile_px = 4;
constexpr double kSkippedBorder_px = 5.0;  // by TagDetector
constexpr double kRegionBorder_px = 8.0;   // that, and room for line fits that start outside
constexpr double kCall_px = 400.0;         // fixed cost of a call, about 15 µs
constexpr double kMaxOfImage = 0.5;        // largest cost of regions, relative to the whole image
constexpr int kStrips = 4;
constexpr int kSteadyImages = 3;  // only the loss of a steady tag causes a search of the image

/// Extended to the library's tiles, within the image.
ImageRegion aligned(const Eigen::Vector2d& low, const Eigen::Vector2d& high, int step, int width,
                    int height) {
  const auto inside = [](double v, int most) {
    return static_cast<int>(std::clamp(v, 0.0, double(most)));
  };
  const auto up = [&](int v, int most) { return std::min((v + step - 1) / step * step, most); };
  return {inside(std::floor(low.x()), width) / step * step,
          inside(std::floor(low.y()), height) / step * step,
          up(inside(std::ceil(high.x()) + 1, width), width),
          up(inside(std::ceil(high.y()) + 1, height), height)};
}

std::optional<SearchRegion> region_of(const ExpectedTag& tag, int width, int height,
                                      const RegionRules& rules) {
  const bool finite =
      std::ranges::all_of(tag.corners_px, [](const Eigen::Vector2d& px) { return px.allFinite(); });
  if (!finite || !std::isfinite(tag.sigma_px)) return std::nullopt;
  const PixelBox box = bounds_of(tag.corners_px);
  const TagOutline outline = outline_of(tag.corners_px);
  const double away = rules.sigmas * tag.sigma_px;
  const Eigen::Vector2d last(width - 1, height - 1);
  if ((box.low.array() < -away).any() || (box.high.array() > last.array() + away).any())
    return std::nullopt;
  const double margin = away + rules.outer_ring * outline.longest_px + kRegionBorder_px;
  SearchRegion region;
  region.decimate = static_cast<int>(std::clamp(
      std::floor(outline.width_px / rules.decimated_width_px), 1.0, double(rules.max_decimate)));
  region.pixels = aligned(box.low.array() - margin, box.high.array() + margin,
                          kTile_px * region.decimate, width, height);
  return region;
}

/// Both regions, with the finer decimation and its tiles.
SearchRegion joined(const SearchRegion& a, const SearchRegion& b, int width, int height) {
  SearchRegion both;
  both.decimate = std::min(a.decimate, b.decimate);
  const Eigen::Vector2d low(std::min(a.pixels.left, b.pixels.left),
                            std::min(a.pixels.top, b.pixels.top));
  const Eigen::Vector2d high(std::max(a.pixels.right, b.pixels.right) - 1,
                             std::max(a.pixels.bottom, b.pixels.bottom) - 1);
  both.pixels = aligned(low, high, kTile_px * both.decimate, width, height);
  return both;
}

/// Joins region i with another one when that is cheaper. @return true when joined
bool grow(std::vector<SearchRegion>& regions, std::size_t i, int width, int height) {
  for (std::size_t j = 0; j < regions.size(); ++j) {
    if (j == i) continue;
    const SearchRegion both = joined(regions[i], regions[j], width, height);
    if (both.cost() > regions[i].cost() + regions[j].cost()) continue;
    regions[std::min(i, j)] = both;
    regions[std::max(i, j)] = regions.back();
    regions.pop_back();
    return true;
  }
  return false;
}

/// One print found twice, as opposed to an id printed twice.
bool is_same_print(const TagSighting& a, const TagSighting& b) {
  const double size = (a.corners_px[2] - a.corners_px[0]).norm();
  return a.tag_id == b.tag_id &&
         (centre_of(a.corners_px) - centre_of(b.corners_px)).norm() < 0.25 * size;
}

/// Within the searched part of the image at any probable position.
bool is_surely_inside(const ExpectedTag& tag, const GrayImage& image, double sigmas) {
  const double border = kSkippedBorder_px + sigmas * tag.sigma_px;
  return std::ranges::all_of(tag.corners_px, [&](const Eigen::Vector2d& px) {
    return px.x() > border && px.y() > border && px.x() < image.width - 1 - border &&
           px.y() < image.height - 1 - border;
  });
}

}  // namespace

double SearchRegion::cost() const {
  return double(pixels.width()) * pixels.height() / (decimate * decimate) + kCall_px;
}

void plan_regions(std::span<const ExpectedTag> expected, int width, int height,
                  const RegionRules& rules, std::vector<SearchRegion>& out) {
  out.clear();
  for (const ExpectedTag& tag : expected)
    if (const auto region = region_of(tag, width, height, rules)) out.push_back(*region);
  for (std::size_t i = 0; i < out.size();) i = grow(out, i, width, height) ? 0 : i + 1;
}

TagSearch::TagSearch(const TagSetConfig& tags, const DetectorConfig& config)
    : config_(config), detector_(tags, config) {
  rules_.outer_ring = detector_.outer_ring();
}

const CornerFrame& TagSearch::search(const CameraFrame& frame,
                                     std::span<const ExpectedTag> expected) {
  out_.camera = frame.camera;
  out_.exposed_at = frame.exposed_at;
  out_.clock_shift = frame.clock_shift;
  out_.tags.clear();
  out_.pixel_noise = 0;
  out_.fitted_straight_sides = true;
  if (frame.image == nullptr || frame.image->pixels.empty() || frame.camera < 0) return out_;
  const GrayImage& image = *frame.image;
  if (cameras_.size() <= std::size_t(frame.camera)) cameras_.resize(std::size_t(frame.camera) + 1);
  Camera& camera = cameras_[std::size_t(frame.camera)];
  ++statistics_.images;
  noise_ = pixel_noise(image);
  out_.pixel_noise = noise_.value_or(0.0);
  const int contrast = noise_ && config_.adapt_contrast ? contrast_above(*noise_, config_)
                                                        : config_.min_white_black_diff;
  regions_.clear();
  if (config_.regions) plan_regions(expected, image.width, image.height, rules_, regions_);
  bool whole_too = true;
  double cost = 0;
  for (const SearchRegion& region : regions_) cost += region.cost();
  if (!regions_.empty() && cost < kMaxOfImage * image.width * image.height) {
    for (const SearchRegion& region : regions_)
      detector_.detect(image, region.pixels, {double(region.decimate), contrast}, out_.tags);
    statistics_.regions += regions_.size();
    const bool missed = note_found(camera, image, expected);
    whole_too = search_is_due(camera, frame) || missed;
  }
  if (whole_too) {
    ++statistics_.whole_images;
    detector_.detect(image, whole(image), {config_.decimate, contrast}, out_.tags);
    camera.searched_at = frame.exposed_at;
    if (config_.regions && config_.decimate > 1) search_strip(camera, frame, contrast);
  }
  drop_repeated();
  return out_;
}

void TagSearch::search_strip(Camera& camera, const CameraFrame& frame, int contrast) {
  const bool due = !camera.strip_at || frame.exposed_at < *camera.strip_at ||
                   frame.exposed_at - *camera.strip_at >= from_seconds(config_.search_period_s);
  if (!due) return;
  camera.strip_at = frame.exposed_at;
  const GrayImage& image = *frame.image;
  // Small tags cut by a strip lie completely in the next one.
  const int overlap = static_cast<int>(rules_.decimated_width_px * config_.decimate) + 16;
  const int top = std::max(0, image.height * camera.strip / kStrips - overlap) / 4 * 4;
  camera.strip = (camera.strip + 1) % kStrips;
  const int end = camera.strip == 0 ? image.height : image.height * camera.strip / kStrips;
  detector_.detect(image, {0, top, image.width, end}, {1.0, contrast}, out_.tags);
}

bool TagSearch::note_found(Camera& camera, const GrayImage& image,
                           std::span<const ExpectedTag> expected) {
  bool steady_one_missing = false;
  bool any = false;
  for (const ExpectedTag& tag : expected) {
    const bool found = std::ranges::count(out_.tags, tag.tag_id, &TagSighting::tag_id) > 0;
    any = any || found;
    if (!found && !is_surely_inside(tag, image, rules_.sigmas)) continue;
    ++statistics_.expected;
    statistics_.found += found ? 1 : 0;
    auto steady = std::ranges::lower_bound(camera.steady, tag.tag_id, {}, &Steady::tag_id);
    if (steady == camera.steady.end() || steady->tag_id != tag.tag_id)
      steady = camera.steady.insert(steady, {tag.tag_id, 0});
    steady_one_missing = steady_one_missing || (!found && steady->images >= kSteadyImages);
    steady->images = found ? steady->images + 1 : 0;
  }
  return steady_one_missing || !any;
}

bool TagSearch::search_is_due(Camera& camera, const CameraFrame& frame) const {
  const Duration period = from_seconds(config_.search_period_s);
  if (!camera.searched_at || frame.exposed_at < *camera.searched_at) {
    // Spreads the phases of cameras by the golden ratio.
    constexpr double kGolden = 0.6180339887;
    const double phase = frame.camera * kGolden;
    camera.searched_at =
        frame.exposed_at - from_seconds(config_.search_period_s * (phase - std::floor(phase)));
    return frame.camera == 0;
  }
  return frame.exposed_at - *camera.searched_at >= period;
}

void TagSearch::drop_repeated() {
  // Keeps the sightings of regions, which come first and have the higher resolution.
  auto kept = out_.tags.begin();
  for (auto tag = out_.tags.begin(); tag != out_.tags.end(); ++tag) {
    const bool known = std::any_of(out_.tags.begin(), kept,
                                   [&](const auto& one) { return is_same_print(one, *tag); });
    if (!known) *kept++ = *tag;
  }
  out_.tags.erase(kept, out_.tags.end());
  std::ranges::sort(out_.tags, {}, &TagSighting::tag_id);
}

}  // namespace fiducap
