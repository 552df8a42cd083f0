#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "capture/gray_image.hpp"

namespace fiducap::v4l2 {

/// How gray lies in the bytes of an image.
enum class Layout {
  kBytes,  ///< A byte per pixel, every `step` bytes from byte `first` on.
  kWords,  ///< Two bytes, little-endian, `shift` bits more than eight.
  kBigEndianWords,
  kPacked10,     ///< Four upper bytes, then their lower bits (MIPI): 4 pixels in 5 bytes.
  kPacked12,     ///< Two upper bytes, then their lower bits (MIPI): 2 pixels in 3 bytes.
  kBitStream10,  ///< Ten bits each, upper ones first: 4 pixels in 5 bytes.
  kJpeg,
};

/// A pixel format of the kernel out of which we read gray.
struct PixelFormat {
  std::uint32_t code{};   ///< FourCC.
  std::string_view name;  ///< As configurations say it.
  Layout layout{Layout::kBytes};
  std::size_t first{0};
  std::size_t step{1};
  int shift{0};
};

/// Those that we read, best first: of two that are equally quick the first is used. Gray before
/// colours, eight bits before more, raw before JPEG, which costs milliseconds and corners.
[[nodiscard]] std::span<const PixelFormat> pixel_formats();
/// nullptr: none that we read.
[[nodiscard]] const PixelFormat* pixel_format(std::uint32_t code);
[[nodiscard]] const PixelFormat* pixel_format(std::string_view name);
/// `YUYV`, `Y10 `: as the kernel writes it, characters that cannot be printed as '?'.
[[nodiscard]] std::string code_text(std::uint32_t code);

/// Bytes of a row, as far as its gray goes. @pre format.layout != kJpeg
[[nodiscard]] std::size_t row_bytes(const PixelFormat& format, int width);

/// @param out  its size is the size of the image
/// @return false when there are too few bytes for that; `out` is undefined then
/// @pre format.layout != kJpeg
[[nodiscard]] bool read_gray(const PixelFormat& format, std::span<const std::byte> bytes,
                             std::size_t stride, GrayImage& out);

}  // namespace fiducap::v4l2
