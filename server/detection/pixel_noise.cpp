#include "detection/pixel_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace fiducap {

namespace {

constexpr int kRows = 24;  // spread over the image; whole rows, because memory comes in lines
constexpr int kSitesPerRow = 256;
constexpr std::size_t kFewestSites = 200;
constexpr int kLargest =
    255;  // of the mask's answer that is told apart: noise of 130 and more is "a lot"
constexpr double kQuantile = 0.25;
constexpr double kNormalQuartile = 0.3186394;  // of |x|, x normal
constexpr double kMaskGain = 6.0;              // of the mask for white noise

/// How strongly the 3 × 3 pixels around `middle` differ from a smooth surface; −1 where the sensor
/// is clipped.
int roughness(const std::uint8_t* above, const std::uint8_t* middle, const std::uint8_t* below) {
  const int c = middle[0];
  if (c <= 1 || c >= 254) return -1;
  const int corners = above[-1] + above[1] + below[-1] + below[1];
  const int sides = above[0] + below[0] + middle[-1] + middle[1];
  return std::abs(corners - 2 * sides + 4 * c);
}

}  // namespace

std::optional<double> pixel_noise(const GrayImage& image) {
  if (image.width < 16 || image.height < 16) return std::nullopt;
  std::array<std::uint32_t, kLargest + 1> counts{};
  std::size_t sites = 0;
  const auto width = static_cast<std::size_t>(image.width);
  const int across = std::max(1, (image.width - 2) / kSitesPerRow);
  const int down = std::max(1, (image.height - 2) / kRows);
  for (int v = 1 + down / 2; v < image.height - 1; v += down) {
    const std::uint8_t* row = image.pixels.data() + static_cast<std::size_t>(v) * width;
    for (int u = 1; u < image.width - 1; u += across) {
      const int rough = roughness(row + u - width, row + u, row + u + width);
      if (rough < 0) continue;
      ++counts[static_cast<std::size_t>(std::min(rough, kLargest))];
      ++sites;
    }
  }
  if (sites < kFewestSites) return std::nullopt;
  const double wanted = kQuantile * static_cast<double>(sites);
  double below = 0;
  std::size_t k = 0;
  while (below + counts[k] < wanted) below += counts[k++];
  // Answers are whole numbers: k stands for [k − ½, k + ½), and 0 for half as much.
  const double within = (wanted - below) / counts[k];
  const double quantile = k == 0 ? 0.5 * within : static_cast<double>(k) - 0.5 + within;
  return quantile / (kMaskGain * kNormalQuartile);
}

int contrast_above(double noise, const DetectorConfig& config) {
  // 144 pixels of pure noise span 5.2 sigma, 6.5 in one of a hundred neighbourhoods.
  constexpr double kSigmas = 6.5;
  // The margin of a tag is about half its contrast; quads need some of it to stand out of the
  // threshold.
  constexpr double kOfMargin = 1.25;
  const double most =
      std::max<double>(config.min_white_black_diff, kOfMargin * config.min_decision_margin);
  return static_cast<int>(
      std::lround(std::clamp<double>(kSigmas * noise, config.min_white_black_diff, most)));
}

}  // namespace fiducap
