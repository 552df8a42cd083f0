#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/expected.hpp"
#include "capture/gray_image.hpp"

namespace fiducap::v4l2 {

/// Position of the gray value in the bytes of an image.
enum class Layout {
  kBytes,  ///< A byte per pixel, every `step` bytes from byte `first` on.
  kWords,  ///< Two bytes, little-endian, `shift` bits more than eight.
  kBigEndianWords,
  kPacked10,     ///< Four upper bytes, then their lower bits (MIPI): 4 pixels in 5 bytes.
  kPacked12,     ///< Two upper bytes, then their lower bits (MIPI): 2 pixels in 3 bytes.
  kBitStream10,  ///< Ten bits each, upper ones first: 4 pixels in 5 bytes.
  kJpeg,
};

/// A supported pixel format of the kernel.
struct PixelFormat {
  std::uint32_t code{};   ///< FourCC.
  std::string_view name;  ///< In configurations.
  Layout layout{Layout::kBytes};
  std::size_t first{0};
  std::size_t step{1};
  int shift{0};
};

/// Supported formats, best first: of two with the same rate the first is used. Gray before colour,
/// eight bits before more, raw before JPEG, which costs milliseconds and corner accuracy.
[[nodiscard]] std::span<const PixelFormat> pixel_formats();
/// nullptr: not supported.
[[nodiscard]] const PixelFormat* pixel_format(std::uint32_t code);
[[nodiscard]] const PixelFormat* pixel_format(std::string_view name);
/// `YUYV`, `Y10 `: as the kernel writes it, unprintable characters as '?'.
[[nodiscard]] std::string code_text(std::uint32_t code);

/// Bytes of a row that contain gray. @pre format.layout != kJpeg
[[nodiscard]] std::size_t row_bytes(const PixelFormat& format, int width);

/// @param out  its size is the size of the image
/// @return false when there are too few bytes for that; `out` is undefined then
/// @pre format.layout != kJpeg
[[nodiscard]] bool read_gray(const PixelFormat& format, std::span<const std::byte> bytes,
                             std::size_t stride, GrayImage& out);

/// Decodes the gray channel of a camera's JPEG images, without the colours. One for each thread.
///
/// An incomplete or damaged image is an error: libjpeg would fill the rest with gray.
class JpegGray final {
 public:
  JpegGray();
  ~JpegGray();
  JpegGray(const JpegGray&) = delete;
  JpegGray& operator=(const JpegGray&) = delete;

  /// @param bytes  an image, and possibly padding
  /// @param out    its size is the expected one; another size is an error
  [[nodiscard]] Expected<void> read(std::span<const std::byte> bytes, GrayImage& out);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap::v4l2
