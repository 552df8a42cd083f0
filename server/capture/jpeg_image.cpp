#include "capture/jpeg_image.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgcodecs.hpp>

namespace fiducap {

namespace {

constexpr int kQuality = 80;  // outlines of tags stay sharp; a third of the bytes of 95

/// The share of source pixel `i` that lies in [from, to).
float share_of(int i, double from, double to) {
  return static_cast<float>(std::min(i + 1.0, to) - std::max(double(i), from));
}

/// Adds a row of the source, averaged to the width of `sums`.
void add_row(const std::uint8_t* row, int width, float weight, std::vector<float>& sums) {
  const double step = double(width) / static_cast<double>(sums.size());
  for (std::size_t x = 0; x < sums.size(); ++x) {
    const double from = static_cast<double>(x) * step;
    const double to = std::min(double(width), from + step);
    float sum = 0;
    const int first = static_cast<int>(from);
    const int last = std::min(width - 1, static_cast<int>(std::ceil(to)) - 1);
    for (int i = first; i <= last; ++i) sum += share_of(i, from, to) * row[i];
    sums[x] += weight * sum;
  }
}

}  // namespace

void scale_down(const GrayImage& image, int width, GrayImage& out, std::vector<float>& sums) {
  if (width >= image.width || image.width <= 0 || image.height <= 0) {
    out = image;
    return;
  }
  const double scale = double(image.width) / width;
  const int height = std::max(1, static_cast<int>(std::lround(image.height / scale)));
  out.resize(width, height);
  const double step = double(image.height) / height;
  const auto area = static_cast<float>(scale * step);
  for (int y = 0; y < height; ++y) {
    sums.assign(static_cast<std::size_t>(width), 0.0F);
    const double from = y * step;
    const double to = std::min(double(image.height), from + step);
    const int last = std::min(image.height - 1, static_cast<int>(std::ceil(to)) - 1);
    for (int i = static_cast<int>(from); i <= last; ++i) {
      const std::uint8_t* row =
          image.pixels.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(image.width);
      add_row(row, image.width, share_of(i, from, to), sums);
    }
    std::uint8_t* to_row =
        out.pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    for (std::size_t x = 0; x < sums.size(); ++x)
      to_row[x] = static_cast<std::uint8_t>(std::clamp(sums[x] / area + 0.5F, 0.0F, 255.0F));
  }
}

void encode_jpeg(const GrayImage& image, std::vector<std::uint8_t>& bytes) {
  bytes.clear();
  if (image.width <= 0 || image.height <= 0) return;
  // OpenCV takes a non-const pointer but only reads.
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  if (!cv::imencode(".jpg", pixels, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality})) bytes.clear();
}

}  // namespace fiducap
