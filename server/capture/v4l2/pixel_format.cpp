#include "capture/v4l2/pixel_format.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include <linux/videodev2.h>

namespace fiducap::v4l2 {
namespace {

// Newer than the headers of Debian 12 are only formats that nobody needs here.
constexpr std::array kFormats{
    PixelFormat{V4L2_PIX_FMT_GREY, "GREY"},
    PixelFormat{V4L2_PIX_FMT_Y10, "Y10", Layout::kWords, 0, 2, 2},
    PixelFormat{V4L2_PIX_FMT_Y12, "Y12", Layout::kWords, 0, 2, 4},
    PixelFormat{V4L2_PIX_FMT_Y14, "Y14", Layout::kWords, 0, 2, 6},
    PixelFormat{V4L2_PIX_FMT_Y16, "Y16", Layout::kWords, 0, 2, 8},
    PixelFormat{V4L2_PIX_FMT_Y16_BE, "Y16_BE", Layout::kBigEndianWords, 0, 2, 8},
    PixelFormat{V4L2_PIX_FMT_Y10P, "Y10P", Layout::kPacked10},
    PixelFormat{v4l2_fourcc('Y', '1', '2', 'P'), "Y12P", Layout::kPacked12},
    PixelFormat{V4L2_PIX_FMT_Y10BPACK, "Y10BPACK", Layout::kBitStream10},
    PixelFormat{V4L2_PIX_FMT_NV12, "NV12"},
    PixelFormat{V4L2_PIX_FMT_NV21, "NV21"},
    PixelFormat{V4L2_PIX_FMT_NV16, "NV16"},
    PixelFormat{V4L2_PIX_FMT_NV12M, "NV12M"},
    PixelFormat{V4L2_PIX_FMT_YUV420, "YU12"},
    PixelFormat{V4L2_PIX_FMT_YVU420, "YV12"},
    PixelFormat{V4L2_PIX_FMT_YUV422P, "422P"},
    PixelFormat{V4L2_PIX_FMT_YUYV, "YUYV", Layout::kBytes, 0, 2},
    PixelFormat{V4L2_PIX_FMT_UYVY, "UYVY", Layout::kBytes, 1, 2},
    PixelFormat{V4L2_PIX_FMT_YVYU, "YVYU", Layout::kBytes, 0, 2},
    PixelFormat{V4L2_PIX_FMT_VYUY, "VYUY", Layout::kBytes, 1, 2},
    PixelFormat{V4L2_PIX_FMT_MJPEG, "MJPEG", Layout::kJpeg},
    PixelFormat{V4L2_PIX_FMT_JPEG, "JPEG", Layout::kJpeg},
};

// The loops are plain so that the compiler vectorises them.
template <std::size_t kStep>
void pick_bytes(const std::uint8_t* from, std::size_t count, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] = from[kStep * i];
}

template <std::size_t kLow, std::size_t kHigh>
void shift_words(const std::uint8_t* from, std::size_t count, int shift, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) {
    const int value = from[2 * i + kLow] | from[2 * i + kHigh] << 8;
    to[i] = static_cast<std::uint8_t>(std::min(value >> shift, 255));
  }
}

/// The upper bytes of groups of `kPixels`, which one byte of lower bits follows.
template <std::size_t kPixels>
void skip_lower_bits(const std::uint8_t* from, std::size_t count, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] = from[i + i / kPixels];
}

void upper_bits_of_ten(const std::uint8_t* from, std::size_t count, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t bit = 10 * i;
    const int two = from[bit / 8] << 8 | from[bit / 8 + 1];
    to[i] = static_cast<std::uint8_t>(two >> (8 - bit % 8));
  }
}

void read_row(const PixelFormat& format, const std::uint8_t* from, std::size_t count,
              std::uint8_t* to) {
  switch (format.layout) {
    case Layout::kBytes:
      if (format.step == 1) {
        std::memcpy(to, from, count);
      } else {
        pick_bytes<2>(from + format.first, count, to);
      }
      return;
    case Layout::kWords:
      return shift_words<0, 1>(from, count, format.shift, to);
    case Layout::kBigEndianWords:
      return shift_words<1, 0>(from, count, format.shift, to);
    case Layout::kPacked10:
      return skip_lower_bits<4>(from, count, to);
    case Layout::kPacked12:
      return skip_lower_bits<2>(from, count, to);
    case Layout::kBitStream10:
      return upper_bits_of_ten(from, count, to);
    case Layout::kJpeg:
      return;
  }
}

}  // namespace

std::span<const PixelFormat> pixel_formats() { return kFormats; }

const PixelFormat* pixel_format(std::uint32_t code) {
  const auto* found = std::find_if(kFormats.begin(), kFormats.end(),
                                   [code](const PixelFormat& f) { return f.code == code; });
  return found == kFormats.end() ? nullptr : found;
}

const PixelFormat* pixel_format(std::string_view name) {
  const auto* found = std::find_if(kFormats.begin(), kFormats.end(),
                                   [name](const PixelFormat& f) { return f.name == name; });
  return found == kFormats.end() ? nullptr : found;
}

std::string code_text(std::uint32_t code) {
  std::string text;
  for (int i = 0; i < 4; ++i) {
    const char c = static_cast<char>(code >> (8 * i) & 0x7f);
    text += c >= ' ' && c <= '~' ? c : '?';
  }
  return text;
}

std::size_t row_bytes(const PixelFormat& format, int width) {
  const auto pixels = static_cast<std::size_t>(width);
  switch (format.layout) {
    case Layout::kBytes:
    case Layout::kWords:
    case Layout::kBigEndianWords:
      return pixels * format.step;
    case Layout::kPacked10:
    case Layout::kBitStream10:
      return (pixels * 10 + 7) / 8;
    case Layout::kPacked12:
      return (pixels * 12 + 7) / 8;
    case Layout::kJpeg:
      break;
  }
  return 0;
}

bool read_gray(const PixelFormat& format, std::span<const std::byte> bytes, std::size_t stride,
               GrayImage& out) {
  const auto width = static_cast<std::size_t>(out.width);
  const auto height = static_cast<std::size_t>(out.height);
  const std::size_t row = row_bytes(format, out.width);
  stride = std::max(stride, row);
  if (height == 0 || bytes.size() < stride * (height - 1) + row) return false;
  const auto* from = reinterpret_cast<const std::uint8_t*>(bytes.data());
  if (format.step == 1 && format.layout == Layout::kBytes && stride == width) {
    std::memcpy(out.pixels.data(), from, width * height);
    return true;
  }
  for (std::size_t v = 0; v < height; ++v)
    read_row(format, from + v * stride, width, out.pixels.data() + v * width);
  return true;
}

}  // namespace fiducap::v4l2
