#include "detection/april_grid.hpp"

#include <algorithm>
#include <array>

#include <opencv2/imgproc.hpp>

#include "detection/corner_sigma.hpp"
#include "detection/other_families.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr int kCells = 10;       // along the edge of a tag
constexpr int kBorderCells = 2;  // the black squares are wider
constexpr int kFullSearch_px = 800 * 600;
constexpr int kHalfSearch_px = 2000 * 1500;
constexpr double kSameTag = 0.25;  // distance of centres relative to the edge

/// A search for quads: pixels by which paper grows into black, and steps between searched pixels.
struct Pass {
  int grown_px{};
  double decimate{};
};

std::array<Pass, 3> passes_for(const GrayImage& image) {
  const int pixels = image.width * image.height;
  const int step = pixels <= kFullSearch_px ? 1 : pixels <= kHalfSearch_px ? 2 : 4;
  return {{{step, double(step)}, {2 * step, double(step)}, {0, double(step)}}};
}

GrayImage with_grown_paper(const GrayImage& image, int px) {
  GrayImage grown;
  grown.resize(image.width, image.height);
  const auto mat = [](const GrayImage& of) {
    return cv::Mat(of.height, of.width, CV_8UC1, const_cast<std::uint8_t*>(of.pixels.data()));
  };
  cv::Mat out = mat(grown);
  cv::dilate(mat(image), out, cv::Mat::ones(2 * px + 1, 2 * px + 1, CV_8UC1));
  return grown;
}

/// Moves the corners to the saddle points around them. @return false: there are none
bool refine(const cv::Mat& pixels, int grown_px, TagSighting& tag) {
  const double width_px = outline_of(tag.corners_px).width_px;
  // Within the squares that meet there, at any turn of the tag.
  const int half = std::clamp(static_cast<int>(0.7 * width_px * kBorderCells / kCells), 2, 12);
  const Eigen::Vector2d centre = centre_of(tag.corners_px);
  std::vector<cv::Point2f> corners;
  for (const Eigen::Vector2d& px : tag.corners_px) {
    const Eigen::Vector2d out = px + (px - centre) * (2.0 * grown_px / width_px);
    corners.emplace_back(static_cast<float>(out.x()), static_cast<float>(out.y()));
  }
  const std::vector<cv::Point2f> begin = corners;
  cv::cornerSubPix(pixels, corners, cv::Size(half, half), cv::Size(-1, -1),
                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-3});
  for (std::size_t i = 0; i < 4; ++i) {
    if (!(cv::norm(corners[i] - begin[i]) < half)) return false;
    tag.corners_px[i] = {corners[i].x, corners[i].y};
  }
  return true;
}

DetectorConfig config_of_search() {
  DetectorConfig config;
  config.fit_sides = false;
  return config;
}

}  // namespace

AprilGridSearch::AprilGridSearch() : detector_({.family = kAprilGridFamily}, config_of_search()) {}

std::vector<TagSighting> AprilGridSearch::find(const GrayImage& image) {
  std::vector<TagSighting> found;
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  for (const Pass& pass : passes_for(image)) {
    std::vector<TagSighting> read;
    const GrayImage grown = pass.grown_px > 0 ? with_grown_paper(image, pass.grown_px) : image;
    detector_.detect(grown, whole(grown), {pass.decimate, 5}, read);
    for (TagSighting& tag : read) {
      const bool is_known = std::ranges::any_of(found, [&](const TagSighting& one) {
        return one.tag_id == tag.tag_id &&
               (centre_of(one.corners_px) - centre_of(tag.corners_px)).norm() <
                   kSameTag * outline_of(tag.corners_px).longest_px;
      });
      if (is_known || !refine(pixels, pass.grown_px, tag)) continue;
      tag.sides = measure_sides(image, tag.corners_px, kCells);
      tag.sharpness = least_sharpness(tag.sides);
      found.push_back(tag);
    }
  }
  std::ranges::sort(found, {}, &TagSighting::tag_id);
  return found;
}

}  // namespace fiducap
