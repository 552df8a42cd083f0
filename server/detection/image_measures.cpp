#include "detection/image_measures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace fiducap {
namespace {

constexpr int kStride = 2;
constexpr int kDarkest = 2;
constexpr int kBrightest = 253;
constexpr double kPercentile = 0.01;
constexpr double kSteepestShare = 0.001;  // of the pixels: some edges, not one hot pixel
constexpr double kMinContrast = 8;        // grays; below, steps are noise
constexpr double kSharpStep_px = 2;       // distance of TagSide::sharpness

using Counts = std::array<std::uint32_t, 256>;

/// The gray (or step) with this share of the pixels below it.
int quantile(const Counts& counts, double all, double share) {
  double left = all * share;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    left -= counts[i];
    if (left < 0) return static_cast<int>(i);
  }
  return 255;
}

double share_of(const Counts& counts, int first, int last, double all) {
  return std::accumulate(counts.begin() + first, counts.begin() + last + 1, 0.0) / all;
}

/// Histograms of gray and of steps over two pixels along rows, columns and both diagonals.
void count(const GrayImage& image, Counts& gray, std::array<Counts, 4>& steps) {
  const auto width = static_cast<std::size_t>(image.width);
  for (int v = 1; v + 1 < image.height; v += kStride) {
    const std::uint8_t* row = image.pixels.data() + static_cast<std::size_t>(v) * width;
    for (int u = 1; u + 1 < image.width; u += kStride) {
      const std::uint8_t* p = row + u;
      ++gray[*p];
      const std::uint8_t* above = p - width;
      const std::uint8_t* below = p + width;
      ++steps[0][static_cast<std::size_t>(std::abs(p[1] - p[-1]))];
      ++steps[1][static_cast<std::size_t>(std::abs(below[0] - above[0]))];
      ++steps[2][static_cast<std::size_t>(std::abs(below[1] - above[-1]))];
      ++steps[3][static_cast<std::size_t>(std::abs(below[-1] - above[1]))];
    }
  }
}

constexpr int kNoiseRows = 24;  // spread over the image
constexpr int kSitesPerRow = 256;
constexpr std::size_t kMinSites = 200;
constexpr int kMaxRoughness = 255;  // noise of 130 and more is not distinguished
constexpr double kQuantile = 0.25;
constexpr double kNormalQuartile = 0.3186394;  // of |x|, x normal
constexpr double kMaskGain = 6.0;              // of the mask for white noise

/// Magnitude of the mask's response to the 3 × 3 pixels around `middle`; −1 for clipped pixels.
int roughness(const std::uint8_t* above, const std::uint8_t* middle, const std::uint8_t* below) {
  const int c = middle[0];
  if (c <= 1 || c >= 254) return -1;
  const int corners = above[-1] + above[1] + below[-1] + below[1];
  const int sides = above[0] + below[0] + middle[-1] + middle[1];
  return std::abs(corners - 2 * sides + 4 * c);
}

}  // namespace

ImageMeasures measure(const GrayImage& image) {
  ImageMeasures out;
  const auto pixels = static_cast<std::size_t>(std::max(0, image.width)) *
                      static_cast<std::size_t>(std::max(0, image.height));
  if (image.width < 3 || image.height < 3 || image.pixels.size() < pixels) return out;
  Counts gray{};
  std::array<Counts, 4> steps{};
  count(image, gray, steps);
  double all = 0;
  double sum = 0;
  for (std::size_t i = 0; i < gray.size(); ++i) {
    all += gray[i];
    sum += static_cast<double>(i) * gray[i];
    out.histogram[i * ImageMeasures::kBins / gray.size()] += gray[i];
  }
  out.mean = sum / all;
  out.black = quantile(gray, all, kPercentile);
  out.white = quantile(gray, all, 1 - kPercentile);
  out.dark_share = share_of(gray, 0, kDarkest, all);
  out.bright_share = share_of(gray, kBrightest, 255, all);
  if (out.white - out.black < kMinContrast) return out;
  out.least_steep = 1;
  for (const Counts& step : steps) {
    const double steep = quantile(step, all, 1 - kSteepestShare) / (out.white - out.black);
    out.steepest = std::clamp(steep, out.steepest, 1.0);
    out.least_steep = std::min(out.least_steep, steep);
  }
  return out;
}

ImageBlur blur_of(std::span<const TagSighting> tags) {
  // Unknowns: xx, xy, yy of the ellipse.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  ImageBlur out;
  for (const TagSighting& tag : tags) {
    if (!(tag.sharpness > 0)) continue;
    ++out.tags;
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d along = (tag.corners_px[(i + 1) % 4] - tag.corners_px[i]).normalized();
      const Eigen::Vector3d across(along.y() * along.y(), -2 * along.x() * along.y(),
                                   along.x() * along.x());
      // 0: too blurred to be fitted, so the blurriest of this tag.
      const double sharpness = tag.sides[i].sharpness > 0 ? tag.sides[i].sharpness : tag.sharpness;
      const double blur_px = std::max(1.0, 1 / sharpness) * kSharpStep_px;
      normal += across * across.transpose();
      right += across * (blur_px * blur_px);
    }
  }
  if (out.tags == 0) return out;
  // Sides along rows and columns do not determine xy: regularised to 0.
  normal(1, 1) += 1e-3 * normal.trace();
  const Eigen::Vector3d fit = normal.ldlt().solve(right);
  Eigen::Matrix2d ellipse;
  ellipse << fit[0], fit[1], fit[1], fit[2];
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(ellipse);
  const double sharp = kSharpStep_px * kSharpStep_px;
  const double least = std::max(sharp, axes.eigenvalues()[0]);
  out.focus_px = std::sqrt(least);
  out.motion_px = std::sqrt(std::max(0.0, axes.eigenvalues()[1] - least));
  const Eigen::Vector2d longest = axes.eigenvectors().col(1);
  out.motion_rad = std::atan(longest.y() / (longest.x() == 0 ? 1e-12 : longest.x()));
  return out;
}

std::optional<double> pixel_noise(const GrayImage& image) {
  if (image.width < 16 || image.height < 16) return std::nullopt;
  std::array<std::uint32_t, kMaxRoughness + 1> counts{};
  std::size_t sites = 0;
  const auto width = static_cast<std::size_t>(image.width);
  const int across = std::max(1, (image.width - 2) / kSitesPerRow);
  const int down = std::max(1, (image.height - 2) / kNoiseRows);
  for (int v = 1 + down / 2; v < image.height - 1; v += down) {
    const std::uint8_t* row = image.pixels.data() + static_cast<std::size_t>(v) * width;
    for (int u = 1; u < image.width - 1; u += across) {
      const int rough = roughness(row + u - width, row + u, row + u + width);
      if (rough < 0) continue;
      ++counts[static_cast<std::size_t>(std::min(rough, kMaxRoughness))];
      ++sites;
    }
  }
  if (sites < kMinSites) return std::nullopt;
  const double wanted = kQuantile * static_cast<double>(sites);
  double below = 0;
  std::size_t k = 0;
  while (below + counts[k] < wanted) below += counts[k++];
  // Responses are integers: k represents [k − ½, k + ½), and 0 represents [0, ½).
  const double within = (wanted - below) / counts[k];
  const double quantile = k == 0 ? 0.5 * within : static_cast<double>(k) - 0.5 + within;
  return quantile / (kMaskGain * kNormalQuartile);
}

int contrast_above(double noise, const DetectorConfig& config) {
  // The range of 144 pixels of pure noise is 5.2 sigma, 6.5 in one of a hundred neighbourhoods.
  constexpr double kSigmas = 6.5;
  // The margin of a tag is about half its contrast, some of which the threshold of quads needs.
  constexpr double kOfMargin = 1.25;
  const double limit =
      std::max<double>(config.min_white_black_diff, kOfMargin * config.min_decision_margin);
  return static_cast<int>(
      std::lround(std::clamp<double>(kSigmas * noise, config.min_white_black_diff, limit)));
}

}  // namespace fiducap
