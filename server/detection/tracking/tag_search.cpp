#include "detection/tracking/tag_search.hpp"

#include <algorithm>
#include <cmath>

#include "detection/pixel_noise.hpp"

namespace fiducap {

namespace {

constexpr double kMostOfImage =
    0.5;  // regions that cost more than this share of the whole image do not pay
constexpr int kStrips = 4;
constexpr int kSteadyImages = 3;  // a tag that flickers does not call for a whole search each time
constexpr double kRefusedBorder_px = 5.0;  // see TagDetector

Eigen::Vector2d centre_of(const TagSighting& tag) {
  return 0.25 * (tag.corners_px[0] + tag.corners_px[1] + tag.corners_px[2] + tag.corners_px[3]);
}

/// The same print found twice, not the same id printed twice.
bool is_same_print(const TagSighting& a, const TagSighting& b) {
  const double size = (a.corners_px[2] - a.corners_px[0]).norm();
  return a.tag_id == b.tag_id && (centre_of(a) - centre_of(b)).norm() < 0.25 * size;
}

/// Nothing but its visibility can keep this tag from being found.
bool is_surely_inside(const ExpectedTag& tag, const GrayImage& image, double sigmas) {
  const double border = kRefusedBorder_px + sigmas * tag.sigma_px;
  return std::all_of(tag.corners_px.begin(), tag.corners_px.end(), [&](const Eigen::Vector2d& px) {
    return px.x() > border && px.y() > border && px.x() < image.width - 1 - border &&
           px.y() < image.height - 1 - border;
  });
}

}  // namespace

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
  if (!regions_.empty() && regions_pay(image)) {
    search_regions(image, contrast);
    const bool missed = note_found(camera, image, expected);
    whole_too = search_is_due(camera, frame) || missed;
  }
  if (whole_too) {
    search_whole(image, contrast);
    camera.searched_at = frame.exposed_at;
    if (config_.regions && config_.decimate > 1) search_strip(camera, frame, contrast);
  }
  drop_repeated();
  return out_;
}

void TagSearch::search_regions(const GrayImage& image, int contrast) {
  for (const SearchRegion& region : regions_) {
    detector_.detect(image, region.pixels, {double(region.decimate), contrast}, out_.tags);
  }
  statistics_.regions += regions_.size();
}

void TagSearch::search_whole(const GrayImage& image, int contrast) {
  ++statistics_.whole_images;
  detector_.detect(image, whole(image), {config_.decimate, contrast}, out_.tags);
}

void TagSearch::search_strip(Camera& camera, const CameraFrame& frame, int contrast) {
  const bool due = !camera.strip_at || frame.exposed_at < *camera.strip_at ||
                   frame.exposed_at - *camera.strip_at >= from_seconds(config_.search_period_s);
  if (!due) return;
  camera.strip_at = frame.exposed_at;
  const GrayImage& image = *frame.image;
  // What a strip cuts is small and lies whole in the next one.
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
    const bool found =
        std::any_of(out_.tags.begin(), out_.tags.end(),
                    [&](const TagSighting& seen) { return seen.tag_id == tag.tag_id; });
    any = any || found;
    if (!found && !is_surely_inside(tag, image, rules_.sigmas)) continue;
    ++statistics_.expected;
    statistics_.found += found ? 1 : 0;
    auto steady = std::lower_bound(camera.steady.begin(), camera.steady.end(), tag.tag_id,
                                   [](const Steady& s, int id) { return s.tag_id < id; });
    if (steady == camera.steady.end() || steady->tag_id != tag.tag_id) {
      steady = camera.steady.insert(steady, {tag.tag_id, 0});
    }
    steady_one_missing = steady_one_missing || (!found && steady->images >= kSteadyImages);
    steady->images = found ? steady->images + 1 : 0;
  }
  return steady_one_missing || !any;
}

bool TagSearch::search_is_due(Camera& camera, const CameraFrame& frame) const {
  const Duration period = from_seconds(config_.search_period_s);
  if (!camera.searched_at || frame.exposed_at < *camera.searched_at) {
    // Cameras that start together take turns: their phases are spread by the golden ratio.
    constexpr double kGolden = 0.6180339887;
    const double phase = frame.camera * kGolden;
    camera.searched_at =
        frame.exposed_at - from_seconds(config_.search_period_s * (phase - std::floor(phase)));
    return frame.camera == 0;
  }
  return frame.exposed_at - *camera.searched_at >= period;
}

bool TagSearch::regions_pay(const GrayImage& image) const {
  double cost = 0;
  for (const SearchRegion& region : regions_) cost += region.cost();
  return cost < kMostOfImage * image.width * image.height;
}

void TagSearch::drop_repeated() {
  // Regions come first and see more: what the whole image shows again goes.
  auto kept = out_.tags.begin();
  for (auto tag = out_.tags.begin(); tag != out_.tags.end(); ++tag) {
    const bool known = std::any_of(out_.tags.begin(), kept,
                                   [&](const auto& one) { return is_same_print(one, *tag); });
    if (!known) *kept++ = *tag;
  }
  out_.tags.erase(kept, out_.tags.end());
  std::sort(out_.tags.begin(), out_.tags.end(),
            [](const auto& a, const auto& b) { return a.tag_id < b.tag_id; });
}

}  // namespace fiducap
