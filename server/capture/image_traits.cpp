#include "capture/image_traits.hpp"

#include <algorithm>
#include <cstdlib>

namespace fiducap {
namespace {

using Histogram = std::array<std::uint32_t, 256>;

constexpr int kPixelStep = 8;  // of both axes, for the histogram and fingerprints
constexpr int kEdgeRows = 12;  // between rows looked at for edges
constexpr int kEdgeColumns = 4;
constexpr int kReach = 8;   // pixels; over that an edge is clear …
constexpr int kClear = 60;  // … if it rises by so much: more than noise
constexpr int kWithin = 2;

const std::uint8_t* row_of(const GrayImage& image, int v) {
  return image.pixels.data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width);
}

int quantile_of(const Histogram& histogram, double share) {
  std::uint64_t all = 0;
  for (const std::uint32_t count : histogram) all += count;
  double left = share * static_cast<double>(all);
  for (std::size_t value = 0; value < histogram.size(); ++value) {
    left -= histogram[value];
    if (left <= 0 && histogram[value] > 0) return static_cast<int>(value);
  }
  return 255;
}

/// Histogram, and a fingerprint of each band.
Histogram look_at_pixels(const GrayImage& image, ImageTraits& out) {
  Histogram histogram{};
  std::array<int, ImageTraits::kBands> least{}, most{};
  least.fill(255);
  for (int v = 0; v < image.height; v += kPixelStep) {
    const auto band =
        static_cast<std::size_t>(v) * ImageTraits::kBands / static_cast<std::size_t>(image.height);
    const std::uint8_t* row = row_of(image, v);
    std::uint64_t hash = out.bands[band];
    for (int u = 0; u < image.width; u += kPixelStep) {
      ++histogram[row[u]];
      hash = (hash ^ row[u]) * 0x100000001b3;  // FNV-1a
      least[band] = std::min<int>(least[band], row[u]);
      most[band] = std::max<int>(most[band], row[u]);
    }
    out.bands[band] = hash;
  }
  constexpr int kHardly = 8;
  for (std::size_t band = 0; band < ImageTraits::kBands; ++band)
    out.is_plain[band] = most[band] - least[band] < kHardly;
  return histogram;
}

/// Share of steps between two pixels that are the largest of an edge, counted in hundredths.
class EdgeSteps final {
 public:
  /// @param stride  between two pixels on the way across the edge
  void look(const std::uint8_t* pixel, std::ptrdiff_t stride) {
    const int rise = pixel[kReach * stride] - pixel[0];
    if (std::abs(rise) < kClear) return;
    int largest = 0;
    for (int i = 0; i + kWithin <= kReach; ++i) {
      const int step = pixel[(i + kWithin) * stride] - pixel[i * stride];
      largest = std::max(largest, rise > 0 ? step : -step);
    }
    const int hundredths = std::clamp(100 * largest / std::abs(rise), 0, 100);
    ++steps_[static_cast<std::size_t>(hundredths)];
    ++edges_;
  }
  /// The sharper ones count: some edges are out of focus in any room.
  [[nodiscard]] double sharpness() const {
    constexpr std::uint32_t kLeast = 40;
    if (edges_ < kLeast) return 0;
    std::uint32_t left = edges_ / 5;
    for (std::size_t i = steps_.size(); i-- > 0;) {
      if (steps_[i] >= left) return static_cast<double>(i) / 100;
      left -= steps_[i];
    }
    return 0;
  }

 private:
  std::array<std::uint32_t, 101> steps_{};
  std::uint32_t edges_{0};
};

void look_at_edges(const GrayImage& image, ImageTraits& out) {
  EdgeSteps across, down;
  for (int v = 0; v + kReach < image.height; v += kEdgeRows) {
    const std::uint8_t* row = row_of(image, v);
    for (int u = 0; u + kReach < image.width; u += kEdgeColumns) across.look(row + u, 1);
    for (int u = 0; u < image.width; u += kEdgeColumns) down.look(row + u, image.width);
  }
  out.across = across.sharpness();
  out.down = down.sharpness();
}

/// @return share of the pixels of a row that have this value
double share_of_value(const GrayImage& image, int v, std::uint8_t value) {
  const std::uint8_t* row = row_of(image, v);
  return static_cast<double>(std::count(row, row + image.width, value)) / image.width;
}

/// Rows from one end on that have one value. @param step  1: from the upper end, -1: from the lower
int rows_of_one_value(const GrayImage& image, int step) {
  int v = step > 0 ? 0 : image.height - 1;
  const std::uint8_t value = *row_of(image, v);
  int rows = 0;
  while (rows < image.height && share_of_value(image, v, value) == 1) {
    ++rows;
    v += step;
  }
  if (rows == 0 || rows == image.height) return 0;
  // What is merely black or white in the room ends raggedly; memory that was never filled ends in
  // one row. What never came of a JPEG is gray, and ends within a block of 16 rows.
  const bool is_at_end = value <= 2 || value >= 253;
  const double ragged = is_at_end ? 0.2 : 0.5;
  const int beyond = v + step * (is_at_end ? 1 : 16);
  if (beyond < 0 || beyond >= image.height) return 0;
  return share_of_value(image, beyond, value) < ragged ? rows : 0;
}

}  // namespace

ImageTraits traits_of(const GrayImage& image) {
  ImageTraits out;
  const Histogram histogram = look_at_pixels(image, out);
  constexpr double kTwentieth = 0.05;
  out.dark = quantile_of(histogram, kTwentieth);
  out.bright = quantile_of(histogram, 1 - kTwentieth);
  constexpr std::size_t kWhite = 250;
  std::uint64_t all = 0, white = 0;
  for (std::size_t value = 0; value < histogram.size(); ++value) {
    all += histogram[value];
    if (value >= kWhite) white += histogram[value];
  }
  out.white = static_cast<double>(white) / static_cast<double>(all);
  const int rows = std::max(rows_of_one_value(image, 1), rows_of_one_value(image, -1));
  out.missing = static_cast<double>(rows) / image.height;
  look_at_edges(image, out);
  return out;
}

}  // namespace fiducap
