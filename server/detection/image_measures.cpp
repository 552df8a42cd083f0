#include "detection/image_measures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace fiducap {

namespace {

constexpr int kStride = 2;
constexpr int kDarkest = 2;
constexpr int kBrightest = 253;
constexpr double kPercentile = 0.01;
constexpr double kSteepestShare = 0.001;  // of the pixels: some edges, not one hot pixel
constexpr double kLeastContrast = 8;      // grays; below, steps are noise
constexpr double kSharpStep_px = 2;       // TagSide::sharpness is the share of a step within these

using Counts = std::array<std::uint32_t, 256>;

/// Below which gray (or step) this share of all lies.
int quantile(const Counts& counts, double all, double share) {
  double left = all * share;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    left -= counts[i];
    if (left < 0) return static_cast<int>(i);
  }
  return 255;
}

double share_of(const Counts& counts, int first, int last, double all) {
  double sum = 0;
  for (int i = first; i <= last; ++i) sum += counts[static_cast<std::size_t>(i)];
  return sum / all;
}

/// `gray` and `step`: how often each comes.
void count(const GrayImage& image, Counts& gray, Counts& step) {
  const auto width = static_cast<std::size_t>(image.width);
  for (int v = 1; v + 1 < image.height; v += kStride) {
    const std::uint8_t* row = image.pixels.data() + static_cast<std::size_t>(v) * width;
    for (int u = 1; u + 1 < image.width; u += kStride) {
      const std::uint8_t* p = row + u;
      ++gray[*p];
      const int across = std::abs(p[1] - p[-1]);
      const int down = std::abs(p[width] - *(p - width));
      ++step[static_cast<std::size_t>(std::max(across, down))];
    }
  }
}

}  // namespace

ImageMeasures measure(const GrayImage& image) {
  ImageMeasures out;
  const auto pixels = static_cast<std::size_t>(std::max(0, image.width)) *
                      static_cast<std::size_t>(std::max(0, image.height));
  if (image.width < 3 || image.height < 3 || image.pixels.size() < pixels) return out;
  Counts gray{};
  Counts step{};
  count(image, gray, step);
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
  if (out.white - out.black < kLeastContrast) return out;
  out.steepest = std::min(1.0, quantile(step, all, 1 - kSteepestShare) / (out.white - out.black));
  return out;
}

ImageBlur blur_of(std::span<const TagSighting> tags) {
  // Unknown: the ellipse's xx, xy, yy.
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
      // 0: too smeared to be fitted; then it is the least sharp one of this tag.
      const double sharpness = tag.sides[i].sharpness > 0 ? tag.sides[i].sharpness : tag.sharpness;
      const double smear_px = std::max(1.0, 1 / sharpness) * kSharpStep_px;
      normal += across * across.transpose();
      right += across * (smear_px * smear_px);
    }
  }
  if (out.tags == 0) return out;
  // Squares that stand upright say nothing of motion along their diagonals: then there is none.
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

}  // namespace fiducap
